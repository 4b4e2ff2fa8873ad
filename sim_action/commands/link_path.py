"""The path of a link along straight lines, and the joint positions that follow it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import accumulate, takewhile
from typing import Final, NamedTuple

from sim_action.commands.joints import Blend
from sim_action.core import geometry, units
from sim_action.core.geometry import Pose, Quaternion, Twist, Vector3
from sim_action.core.lazy_numpy import FloatArray, np
from sim_action.core.records import dataclass, replace
from sim_action.robot.model.inverse_kinematics import REACHED_M, Chain, Solution, Values, reach, search
from sim_action.robot.model.robot_model import STOP_SLACK
from sim_action.state.joint_motion import RAMP_S, Curve, JointMotion, straight

# Joint positions are found before the run once per this distance in m, and per this angle in rad. The line between two
# of them is straight within micrometres.
_SAMPLE_M: Final = 0.002
_SAMPLE_RAD: Final = 0.01
_MIN_SAMPLES: Final = 4

# During the run, they are found at each tick, and once per this distance and angle.
_MAX_STEP_M: Final = 0.01
_MAX_STEP_RAD: Final = 0.05

# A base that moves also tilts a little, which an arm with few joints cannot correct. In m and rad.
_SLACK_M: Final = 0.002
_SLACK_RAD: Final = math.radians(1)
_JUMP: Final = 0.5  # a joint that moves by more than this in rad or m on such a step has jumped to another posture
_SHARE_ROUNDING: Final = 1e-6  # the share by which a speed may exceed its limit: rounding of models


class Leg(NamedTuple):
    """A straight line of the path, from rest or passing through."""

    waypoint: int  # index of the waypoint at its end
    start: float  # start, end: sim time in s
    end: float
    origin: Pose  # origin, goal: poses of the link at both ends
    goal: Pose
    # True if it begins at rest, and True if it ends at rest: a straight blend passes other waypoints
    rests: tuple[bool, bool] = (True, True)


class Target(NamedTuple):
    """A pose of the link in the frame of the path, and that frame seen from the base."""

    pose: Pose
    to_base: Pose


class Blocked(Exception):
    """A path that the robot cannot follow; `waypoint` is the index of the waypoint at the end of the line."""

    def __init__(self, waypoint: int, message: str) -> None:
        self.waypoint = waypoint
        super().__init__(message)


@dataclass(frozen=True, slots=True)
class LinkPath:
    """The pose of a link over time, along straight lines; the orientation turns about a fixed axis on each of them."""

    legs: tuple[Leg, ...]  # in the order of time; the link waits between two of them
    rest: Pose  # the pose of the link before the first leg
    blend: Blend

    def beginning(self, follower: Follower, waypoints: int, samples: int) -> LinkPath:
        """Return the legs to the first waypoints, as far as a number of joint positions is enough for them."""
        totals = accumulate(follower.samples(leg) for leg in self.legs)
        pairs = zip(self.legs, totals, strict=True)
        legs = takewhile(lambda pair: pair[0].waypoint < waypoints and pair[1] <= samples, pairs)
        return replace(self, legs=tuple(leg for leg, _ in legs))

    @property
    def end(self) -> float:
        """The time of arrival in s."""
        return self.legs[-1].end if self.legs else 0.0

    def leg(self, time: float) -> tuple[int, float]:
        """Return the index of the present or last leg, -1 before the first, and the share of it that is done."""
        present = -1
        for index, leg in enumerate(self.legs):
            if leg.start < time + units.TIME_EPSILON_S:
                present = index
        if present < 0:
            return present, 0.0
        leg = self.legs[present]
        return present, 1.0 if time >= leg.end - units.TIME_EPSILON_S else self.shares(leg).at(time)[0]

    def shares(self, leg: Leg) -> Curve:
        """Return the share of a leg over time."""
        return _shares(leg.start, leg.end, leg.rests, self.blend)

    def pose(self, time: float) -> Pose:
        """Return the wanted pose at a sim time in s."""
        index, share = self.leg(time)
        return self.rest if index < 0 else between(self.legs[index].origin, self.legs[index].goal, share)


@lru_cache(maxsize=4)
def _shares(start: float, end: float, rests: tuple[bool, bool], blend: Blend) -> Curve:
    if all(rests) or blend.curve is not straight:
        return blend.curve((start, end), (0.0, 1.0))
    ramp = min(RAMP_S, (end - start) / 2)
    speed = 1 / (end - start - ramp * sum(rests) / 2)
    first, last = (0.0 if rest else speed for rest in rests)
    return straight((start, end), (0.0, 1.0), first, last)


def between(origin: Pose, goal: Pose, share: float) -> Pose:
    """Return the pose at a share of a straight line; it turns about one axis, on the short way."""
    if share == 1.0:
        return goal
    ways = zip(origin.position_xyz, goal.position_xyz, strict=True)
    x, y, z = (at + share * (to - at) for at, to in ways)
    turn = geometry.twist_between(origin, goal, 1.0).angular_xyz
    part: Vector3 = (share * turn[0], share * turn[1], share * turn[2])
    return Pose((x, y, z), geometry.multiply(_rotation(part), origin.orientation_xyzw))


def after(pose: Pose, twist: Twist, seconds: float) -> Pose:
    """Return a pose after some time of motion at a twist, both in the same frame."""
    x, y, z = (at + seconds * speed for at, speed in zip(pose.position_xyz, twist.linear_xyz, strict=True))
    turn = (seconds * twist.angular_xyz[0], seconds * twist.angular_xyz[1], seconds * twist.angular_xyz[2])
    return Pose((x, y, z), geometry.multiply(_rotation(turn), pose.orientation_xyzw))


def _rotation(turn: Vector3) -> Quaternion:
    angle = math.hypot(*turn)
    scale = math.sin(angle / 2) / angle if angle else 0.5
    return (turn[0] * scale, turn[1] * scale, turn[2] * scale, math.cos(angle / 2))


def distances(origin: Pose, goal: Pose) -> tuple[float, float]:
    """Return the distance in m and the angle in rad between two poses."""
    turn = geometry.twist_between(origin, goal, 1.0).angular_xyz
    return math.dist(origin.position_xyz, goal.position_xyz), math.hypot(*turn)


@dataclass(frozen=True, slots=True)
class Plan:
    """The joint positions along a path."""

    path: LinkPath
    start: Values  # those before the first leg
    samples: tuple[tuple[Values, ...], ...]  # for each leg, those at equal distances from its origin to its goal

    def motion(self, names: Sequence[str]) -> JointMotion:
        """Return the motion of the joints, by their names. It cuts the corners at waypoints that it passes."""
        if not self.path.legs:
            return JointMotion.through(names, [0.0], [self.start])
        parts = [along(self.path, leg, samples) for leg, samples in zip(self.path.legs, self.samples, strict=True)]
        times, *states = (np.concatenate(pieces) for pieces in zip(*(part[1:] for part in parts), strict=True))
        _, first = np.unique(times, return_index=True)
        return JointMotion.through(names, times[first], *(state[first] for state in states))


def along(path: LinkPath, leg: Leg, samples: Sequence[Values]) -> tuple[FloatArray, ...]:
    """Return shares and times (K,) in s, and (K, J) positions, velocities, accelerations of joints on a leg."""
    blend, half = path.shares(leg), min(RAMP_S, leg.end - leg.start) / 2
    times = np.unique(np.concatenate((blend.times, np.linspace(leg.start, leg.end, len(samples)))))
    early, late = (0.0 if rests else half for rests in leg.rests)
    if blend.times.size > 2:
        times = times[(times >= leg.start + early) & (times <= leg.end - late)]
    share, speed, change = blend.states(times)
    table = np.array(samples)
    steps = np.linspace(0.0, 1.0, len(samples))
    states = [Curve.through(steps, column).states(share) for column in table.T]
    at, slope, bend = (np.stack(columns, axis=1) for columns in zip(*states, strict=True))
    return share, times, at, slope * speed[:, None], bend * speed[:, None] ** 2 + slope * change[:, None]


@dataclass(frozen=True, slots=True)
class Follower:
    """Finds joint positions that follow the poses of a link."""

    chain: Chain
    turns: bool  # False if any orientation will do
    rate: float  # ticks per second

    def plan(self, path: LinkPath, base: Pose, start: Values) -> Plan:
        """Return the joint positions along a path, from the pose of the base in its frame. Raises Blocked."""
        to_base = geometry.inverse(base)
        samples = []
        values = start
        for leg in path.legs:
            count = self.samples(leg)
            positions = [values]
            for step in range(1, count + 1):
                pose = between(leg.origin, leg.goal, step / count)
                values = self._reached(leg, step / count, Target(pose, to_base), values)
                positions.append(values)
            self._refuse_fast(path, leg, positions)
            samples.append(tuple(positions))
        return Plan(path, start, tuple(samples))

    def follow(self, path: LinkPath, tick: int, base: Pose, values: Values) -> Values:
        """Return the joint positions at a tick, from those before; `base`: its pose as for the path. Raises Blocked."""
        to_base = geometry.inverse(base)
        start, end = (tick - 1) / self.rate, tick / self.rate
        way = distances(self.chain.pose(values), geometry.compose(to_base, path.pose(end)))
        steps = self._steps(*way, _MAX_STEP_M, _MAX_STEP_RAD)
        for step in range(1, steps + 1):
            time = end if step == steps else start + (end - start) * step / steps
            index, share = path.leg(time)
            leg = path.legs[index] if index >= 0 else Leg(0, 0.0, 0.0, path.rest, path.rest)
            values = self._reached(leg, share, Target(path.pose(time), to_base), values, slack=1)
        return values

    def samples(self, leg: Leg) -> int:
        """Return the number of joint positions that are found before the run for a leg."""
        return max(_MIN_SAMPLES, self._steps(*distances(leg.origin, leg.goal), _SAMPLE_M, _SAMPLE_RAD))

    def _steps(self, distance: float, angle: float, longest: float, widest: float) -> int:
        return max(1, math.ceil(distance / longest), math.ceil(angle / widest) if self.turns else 1)

    def _reached(self, leg: Leg, share: float, target: Target, values: Values, *, slack: int = 0) -> Values:
        """Return the joint positions at a pose near a known one; `slack` 1: a little off will do. Raises Blocked."""
        pose, to_base = target
        goal = geometry.compose(to_base, pose)
        solution = reach(self.chain, goal, values, turns=self.turns)
        moved = max(abs(reached - before) for reached, before in zip(solution.values, values, strict=True))
        is_near = solution.distance <= slack * _SLACK_M and solution.angle <= slack * _SLACK_RAD
        if (solution.is_reached or is_near) and moved <= _JUMP:
            return solution.values
        elsewhere = search(self.chain, goal, solution.values, turns=self.turns)
        where = f"{100 * share:.0f} % of the way to this waypoint, at {place(pose)}"
        if elsewhere.is_reached:
            stuck = self._at_limits(solution.values)
            message = f"the arm cannot follow the straight line beyond {where}{f' ({stuck})' if stuck else ''}"
            message = f"{message}: it would have to change its posture, such as turn its elbow over"
        else:
            message = f"the straight line leads out of reach: {where}, the link {miss(elsewhere, to_base)}"
        hint = "add a waypoint that leads around this place, or start in another posture (robot.joints)"
        raise Blocked(leg.waypoint, f"{message}; {hint}")

    def _at_limits(self, values: Values) -> str:
        names = [
            f"joint '{joint.name}' is at its limit, {units.display(value, joint.dimension('position').si)}"
            for joint, value, lower, upper in zip(
                self.chain.joints, values, self.chain.lower, self.chain.upper, strict=True
            )
            if value - lower < STOP_SLACK or upper - value < STOP_SLACK
        ]
        return ", ".join(names)

    def _refuse_fast(self, path: LinkPath, leg: Leg, samples: Sequence[Values]) -> None:
        """Raise Blocked if a joint would exceed its velocity limit."""
        shares, _, _, speeds, _ = along(path, leg, samples)
        ratios = np.abs(speeds) / np.array(self.chain.fastest)
        row, column = np.unravel_index(int(np.argmax(ratios)), ratios.shape)
        ratio, share, duration = float(ratios[row, column]), float(shares[row]), leg.end - leg.start
        if ratio <= 1 + _SHARE_ROUNDING:
            return
        joint, fastest = self.chain.joints[column], self.chain.fastest[column]
        speed, most = units.display_apart(ratio * fastest, fastest, joint.dimension("velocity").si)
        raise Blocked(
            leg.waypoint,
            f"{100 * share:.0f} % of the way to this waypoint, joint '{joint.name}' would move at "
            f"{speed}, more than its velocity limit, {most}; the way takes {duration:.4g} s and needs at least "
            f"{math.ceil(duration * ratio * 100) / 100:.6g} s: lower the speed, or go another way",
        )


def place(pose: Pose) -> str:
    """Return a position as messages show it."""
    x, y, z = (f"{value + 0.0:.3f}".replace("-0.000", "0.000") for value in pose.position_xyz)
    return f"({x}, {y}, {z})"


def miss(nearest: Solution, to_base: Pose) -> str:
    """Return by how much a target is missed; `to_base`: the frame of the target, seen from the base."""
    if nearest.distance > REACHED_M:
        at = place(geometry.compose(geometry.inverse(to_base), nearest.pose))
        return f"is {units.display(nearest.distance, 'm', 3)} out of reach; the nearest position is {at}"
    angle = units.display(nearest.angle, "rad", 3)
    return f"cannot have this orientation there: the nearest one is {angle} off"


def unreachable(follower: Follower, goals: Iterable[Pose], base: Pose, start: Values) -> Iterator[tuple[int, str]]:
    """Yield the index of each unreachable waypoint, and a message; `base`: its pose in the frame of the goals."""
    values, to_base = start, geometry.inverse(base)
    for index, goal in enumerate(goals):
        solution = search(follower.chain, geometry.compose(to_base, goal), values, turns=follower.turns)
        if not solution.is_reached:
            yield index, f"link '{follower.chain.link}' {miss(solution, to_base)}"
        values = solution.values
