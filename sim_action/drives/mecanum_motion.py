"""The live half of mecanum wheels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Final

from sim_action.core.geometry import Twist, Vector3
from sim_action.drives import is_level
from sim_action.drives.heading import Rolling, along
from sim_action.drives.wheel_speeds import WheelSpeeds
from sim_action.state.command import NO_PUSH, BasePush, JointTargets

NOT_LEVEL: Final = "a twist asked for more than velocity over the ground and turning rate; the rest was left out"


@dataclass(frozen=True, slots=True)
class Roller:
    """A wheel with rollers at 45 deg, which form an X seen from above.

    Attributes:
        gear: m that it would roll forward while its joint turns by 1 rad.
        way: 1 if it is in front on the left, or in the rear on the right; -1 on the other diagonal.
    """

    place: Rolling
    gear: float
    way: int

    def speed(self, ahead: float, left: float, turn: float) -> float:
        """Of its joint in rad/s, for a velocity of the base in m/s and rad/s."""
        here = (ahead - turn * self.place.left, left + turn * self.place.ahead)
        # Its rollers give way along one diagonal: what is left is across.
        return (here[0] - self.way * here[1]) / self.gear


def arm(wheels: Sequence[Rolling]) -> float:
    """How far wheels are from the base's origin in the mean, in m."""
    return fmean(math.hypot(placed.ahead, placed.left) for placed in wheels)


class MecanumMotion:
    """Velocity over the ground and turning rate, ramping towards what the last twist asks for."""

    def __init__(
        self,
        wheels: Sequence[Roller],
        *,
        heading: float,
        most_change: float,
        speeds: WheelSpeeds,
        force: float,
        point_xyz: Vector3,
    ) -> None:
        """`most_change`: m/s a step, of the velocity, and of what turning is at the wheels."""
        self._wheels = tuple(wheels)
        self._heading = heading
        self._most_change = most_change
        self._speeds = speeds
        self._force = force
        self._point_xyz = point_xyz
        self._arm = arm([found.place for found in wheels])
        self._ahead = self._left = self._turn = 0.0
        self._was_level = True

    @property
    def joints(self) -> frozenset[str]:
        """See DriveMotion.joints."""
        return frozenset(found.place.joint for found in self._wheels)

    @property
    def notes(self) -> tuple[str, ...]:
        """See DriveMotion.notes."""
        return (*(() if self._was_level else (NOT_LEVEL,)), *self._speeds.notes)

    @property
    def released(self) -> JointTargets:
        """See DriveMotion.released."""
        return JointTargets(base=NO_PUSH)

    def targets(self, twist: Twist, steps: int) -> list[JointTargets]:
        """See DriveMotion.targets."""
        self._was_level &= is_level(twist)
        wanted = self._wanted(twist)
        planned = []
        for _ in range(steps):
            before = (self._ahead, self._left, self._turn)
            self._step(*wanted)
            planned.append(self._joint_targets())
            if before == (self._ahead, self._left, self._turn):
                break
        return planned

    def _wanted(self, twist: Twist) -> tuple[float, float, float]:
        """Velocity ahead and to the left and turning rate, as far as motors can."""
        (ahead, left, _), turn = twist.linear_xyz, twist.angular_xyz[2]
        share = self._speeds.told_share(self._joint_speeds(ahead, left, turn))
        return share * ahead, share * left, share * turn

    def _step(self, ahead: float, left: float, turn: float) -> None:
        """All three change by the same part of their way, so that the curve stays the one that was asked for."""
        change = math.hypot(ahead - self._ahead, left - self._left) + self._arm * abs(turn - self._turn)
        if change <= self._most_change:
            self._ahead, self._left, self._turn = ahead, left, turn
            return
        part = self._most_change / change
        self._ahead += part * (ahead - self._ahead)
        self._left += part * (left - self._left)
        self._turn += part * (turn - self._turn)

    def _joint_targets(self) -> JointTargets:
        velocity_xy = along(self._heading, self._ahead, self._left)
        return JointTargets(
            velocity=self._joint_speeds(self._ahead, self._left, self._turn),
            base=BasePush(velocity_xy, self._turn, self._point_xyz, self._force, self._force * self._arm),
        )

    def _joint_speeds(self, ahead: float, left: float, turn: float) -> dict[str, float]:
        """In rad/s, for a velocity of the base in m/s and rad/s."""
        return {found.place.joint: found.speed(ahead, left, turn) for found in self._wheels}
