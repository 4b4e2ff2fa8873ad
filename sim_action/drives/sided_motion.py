"""The live half of drives that steer by the difference of two sides of wheels."""

from __future__ import annotations

from collections.abc import Mapping

from sim_action.command import JointTargets
from sim_action.drives import NOT_PLANAR, is_planar
from sim_action.drives.ramp import towards
from sim_action.geometry import Twist


class SidedMotion:
    """Rim speeds of both sides, ramping towards what the last twist asks for."""

    def __init__(
        self,
        left: Mapping[str, float],
        right: Mapping[str, float],
        *,
        separation: float,
        most_change: float,
        torque: float | None,
    ) -> None:
        """`left`, `right`: joint -> m that its wheel rolls forward while it turns by 1 rad.

        `separation`: m, as it is in effect; `most_change`: of a rim, in m/s a step.
        """
        self._left_gears, self._right_gears = left, right
        self._half_separation = separation / 2
        self._most_change = most_change
        self._max_effort = {} if torque is None else dict.fromkeys((*left, *right), torque)
        self._left = self._right = 0.0
        self._was_planar = True

    @property
    def joints(self) -> frozenset[str]:
        """See DriveMotion.joints."""
        return frozenset((*self._left_gears, *self._right_gears))

    @property
    def notes(self) -> tuple[str, ...]:
        """See DriveMotion.notes."""
        return () if self._was_planar else (NOT_PLANAR,)

    @property
    def released(self) -> JointTargets:
        """See DriveMotion.released."""
        return JointTargets()

    def targets(self, twist: Twist, steps: int) -> list[JointTargets]:
        """See DriveMotion.targets."""
        self._was_planar &= is_planar(twist)
        turn = twist.angular_xyz[2] * self._half_separation
        left, right = twist.linear_xyz[0] - turn, twist.linear_xyz[0] + turn
        planned = []
        for _ in range(steps):
            before = (self._left, self._right)
            self._left = towards(left, self._left, self._most_change)
            self._right = towards(right, self._right, self._most_change)
            planned.append(self._joint_targets())
            if before == (self._left, self._right):
                break
        return planned

    def _joint_targets(self) -> JointTargets:
        left = {name: self._left / gear for name, gear in self._left_gears.items()}
        right = {name: self._right / gear for name, gear in self._right_gears.items()}
        return JointTargets(velocity=left | right, max_effort=self._max_effort)
