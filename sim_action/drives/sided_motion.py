"""The live half of drives that steer by the difference of two sides of wheels."""

from __future__ import annotations

from collections.abc import Mapping

from sim_action.core.geometry import Twist
from sim_action.drives import NOT_PLANAR, is_planar
from sim_action.drives.ramp import towards
from sim_action.drives.wheel_speeds import WheelSpeeds
from sim_action.state.command import JointTargets


class SidedMotion:
    """Rim speeds of both sides, ramping towards what the last twist asks for."""

    def __init__(
        self,
        left: Mapping[str, float],
        right: Mapping[str, float],
        *,
        separation: float,
        most_change: float,
        speeds: WheelSpeeds,
        torque: float | None,
    ) -> None:
        """`left`, `right`: joint -> m that its wheel rolls forward while it turns by 1 rad.

        `separation`: m, as it is in effect; `most_change`: of a rim, in m/s a step.
        """
        self._left_gears, self._right_gears = left, right
        self._half_separation = separation / 2
        self._most_change = most_change
        self._speeds = speeds
        self._max_effort = {} if torque is None else dict.fromkeys((*left, *right), torque)
        self._left = self._right = 0.0
        self._was_planar = True
        self._joints = frozenset((*left, *right))

    @property
    def joints(self) -> frozenset[str]:
        """See DriveMotion.joints."""
        return self._joints

    @property
    def notes(self) -> tuple[str, ...]:
        """See DriveMotion.notes."""
        return (*(() if self._was_planar else (NOT_PLANAR,)), *self._speeds.notes)

    @property
    def released(self) -> JointTargets:
        """See DriveMotion.released."""
        return JointTargets()

    def targets(self, twist: Twist, steps: int) -> list[JointTargets]:
        """See DriveMotion.targets."""
        self._was_planar &= is_planar(twist)
        left, right = self._wanted(twist)
        planned = []
        for _ in range(steps):
            before = (self._left, self._right)
            self._left = towards(left, self._left, self._most_change)
            self._right = towards(right, self._right, self._most_change)
            planned.append(self._joint_targets())
            if before == (self._left, self._right):
                break
        return planned

    def _wanted(self, twist: Twist) -> tuple[float, float]:
        """Rim speeds on the left and on the right, in m/s, as far as motors can."""
        turn = twist.angular_xyz[2] * self._half_separation
        left, right = twist.linear_xyz[0] - turn, twist.linear_xyz[0] + turn
        share = self._speeds.told_share(self._joint_speeds(left, right))
        return share * left, share * right

    def _joint_targets(self) -> JointTargets:
        return JointTargets(velocity=self._joint_speeds(self._left, self._right), max_effort=self._max_effort)

    def _joint_speeds(self, left: float, right: float) -> dict[str, float]:
        """In rad/s, for rim speeds in m/s."""
        return {
            **{name: left / gear for name, gear in self._left_gears.items()},
            **{name: right / gear for name, gear in self._right_gears.items()},
        }
