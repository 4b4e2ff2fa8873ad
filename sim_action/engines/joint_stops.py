"""The stops of joints: an engine moves a joint back that has passed its limit within a step.

Engines stop a joint only after it has passed its limit. In a step of 1/240 s, a fast joint passes it by degrees, and
PyBullet never moves a joint back that is more than 0.04 rad or m beyond it. Only the position is set: the engine takes
the speed at the next step, with an impulse on both links. If it does not, because a motor without a limit of effort
presses on the stop, the speed is set too.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final, Self

from sim_action.robot.model.robot_model import STOP_PLAY, STOP_SLACK, RobotModel

# Engines stop a joint only beyond its limit, not at it.
_BEYOND: Final = STOP_PLAY + 1e-6
_NO_RANGE: Final = -math.inf, math.inf
Placed = tuple[int, float, float]


class JointStops:
    """The stops of all joints with hard limits; a joint and its followers stop together. MJCF has soft limits."""

    def __init__(self, ranges: Sequence[Placed], followers: dict[int, list[Placed]]) -> None:
        """Take the stops by place, as the engine orders joints.

        :param ranges: place of a joint, its lower and its upper limit in rad or m.
        :param followers: place of a joint -> the places of its followers, with multiplier and offset.
        """
        self._stops = [(at, lower - STOP_SLACK, upper + STOP_SLACK) for at, lower, upper in ranges]
        self._followers = followers
        # The places of joints that had passed their stops one step before.
        self._pressing = frozenset[int]()

    @classmethod
    def of(cls, model: RobotModel, places: Sequence[int]) -> Self | None:
        """Return the stops of a robot, None if it has none; `places`: of `RobotModel.motor_joints`."""
        joints = () if model.mjcf is not None else model.motor_joints
        place_of = {joint.name: at for joint, at in zip(joints, places, strict=False)}
        followers: dict[int, list[Placed]] = {}
        for joint in joints:
            gear = model.gear(joint.name)
            if gear.joint != joint.name:
                follower = place_of[joint.name], gear.multiplier, gear.offset
                followers.setdefault(place_of[gear.joint], []).append(follower)
        ranges = [(place_of[joint.name], *model.reach(joint.name)) for joint in joints if joint.mimic is None]
        limited = [stop for stop in ranges if stop[1] <= stop[2] and stop[1:] != _NO_RANGE]
        return cls(limited, followers) if limited else None

    def passed(self, positions: Sequence[float]) -> list[tuple[int, float, bool]]:
        """Return the places of joints that have passed their stops, and of their followers.

        Each comes with its new position, and True if its speed is now 0. It is called after each step. `positions`: in
        rad or m, by place.
        """
        moved: list[Placed] = []
        # A loop takes half of the time of a comprehension, and this is done at every step.
        for stop in self._stops:
            if not stop[1] <= positions[stop[0]] <= stop[2]:
                moved.append(stop)  # noqa: PERF401 - see above
        if not (moved or self._pressing):
            return []
        before, self._pressing = self._pressing, frozenset(at for at, _, _ in moved)
        return [(place, to, stop[0] in before) for stop in moved for place, to in self._stopped(*stop, positions)]

    def _stopped(self, at: int, lower: float, upper: float, positions: Sequence[float]) -> Iterator[tuple[int, float]]:
        if math.isfinite(positions[at]):
            stop = upper - STOP_SLACK + _BEYOND if positions[at] > upper else lower + STOP_SLACK - _BEYOND
            yield at, stop
            for follower, ratio, offset in self._followers.get(at, ()):
                yield follower, ratio * stop + offset
