"""The speed and the turn rate of the base, including jumps that the reported velocities do not explain.

An engine reports the velocity of the base at each step. A script that sets the pose of the robot moves it without any
velocity. The motion of a step is a jump if it is longer than the greater of the velocities at both ends explains.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, Self

from sim_action.core import geometry, units
from sim_action.core.lazy_numpy import FloatArray, np
from sim_action.core.records import dataclass, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace, rotation_angles
from sim_action.world.scene import Scene

# The velocities explain their way times this factor, plus a constant for corrections at contacts. In the examples, on
# both engines, at most 0.01 mm and 0.0001 deg of a step are not explained.
_TOLERANCE: Final = 1.1
_CORRECTION_M: Final = 1e-3
_CORRECTION_RAD: Final = math.radians(0.1)
_ONE_STEP: Final = 1.5  # up to this many steps apart, two states follow each other
_MAX_GAP_S: Final = 0.25  # The same in a stored trace. A mean over a longer time says little about a step.
_Ways = Callable[["FloatArray", "FloatArray"], "FloatArray"]


@dataclass(frozen=True, slots=True)
class BaseMotion:
    """The motion of the base from step to step, across blocks of steps."""

    max_gap_s: float  # two states further apart in time are not compared
    # the states (14,) at the last two steps, as far as they are known: time, pose and twist as in `Trace.state`
    recent: tuple[tuple[float, ...], ...] = ()

    @classmethod
    def of(cls, scene: Scene, start: Observation) -> Self:
        """Return the motion before the first step; `start` is the state at t = 0."""
        pose, twist = start.pose, start.twist
        last = (start.time, *pose.position_xyz, *pose.orientation_xyzw, *twist.linear_xyz, *twist.angular_xyz)
        return cls(_ONE_STEP / scene.physics.rate, (last,))

    def of_stored(self) -> Self:
        """Return the motion for a whole stored trace, which may be decimated: mean speeds are real speeds, too."""
        return replace(self, max_gap_s=_MAX_GAP_S)

    def after(self, trace: Trace) -> Self:
        """Return the motion after the steps of `trace`."""
        return replace(self, recent=(*self.recent, *map(tuple, trace.state[-2:, :14].tolist()))[-2:])

    def speed(self, trace: Trace) -> FloatArray:
        """Return the speed at each step, (T,) m/s; after a jump, its length over the time of the step."""
        return self._with_jumps(trace, trace.speed, slice(8, 11), _distances, _CORRECTION_M)

    def turn_rate(self, trace: Trace) -> FloatArray:
        """Return the turn rate at each step, (T,) rad/s; after a jump, its angle over the time of the step."""
        return self._with_jumps(trace, trace.turn_rate, slice(11, 14), _angles, _CORRECTION_RAD)

    def jump(self, trace: Trace, step: int, *, turns: bool) -> str:
        """Return the text of the jump to a step of `trace`: in orientation (`turns`), or else in position."""
        rows = self._rows(trace)
        after = len(rows) - len(trace) + step
        before, landed = rows[after - 1 : after + 1].tolist()
        when = f"between {before[0]:.4f} s and {landed[0]:.4f} s"
        if turns:
            way = units.display(float(_angles(rows[after - 1 : after], rows[after : after + 1])[0]), "rad")
            ends = [f"({', '.join(units.display(angle, 'rad') for angle in _rpy(row))})" for row in (before, landed)]
            fastest = units.display(max(math.hypot(*row[11:14]) for row in (before, landed)), "rad/s")
            return (
                f"jumped by {way}, from roll, pitch, yaw {ends[0]} to {ends[1]} {when}, while it turned with {fastest}"
            )
        way = units.display(math.dist(before[1:4], landed[1:4]), "m")
        ends = [f"({', '.join(f'{round(number, 4) + 0.0:g}' for number in row[1:4])})" for row in (before, landed)]
        fastest = units.display(max(math.hypot(*row[8:11]) for row in (before, landed)), "m/s")
        return f"jumped {way}, from {ends[0]} to {ends[1]} {when}, while it moved with {fastest}"

    def _with_jumps(
        self, trace: Trace, reported: FloatArray, velocity: slice, ways: _Ways, correction: float
    ) -> FloatArray:
        """Return the reported values (T,), with the mean value of the step in place of each jump."""
        if not len(trace):
            return reported
        rows = self._rows(trace)
        before, after = rows[:-1], rows[1:]
        elapsed, values = after[:, 0] - before[:, 0], np.sqrt(np.square(rows[:, velocity]).sum(axis=1))
        moved = ways(before, after)
        explained = np.maximum(values[1:], values[:-1]) * elapsed * _TOLERANCE + correction
        jumped = (moved > explained) & (elapsed <= self.max_gap_s)
        if not jumped.any():
            return reported
        corrected = reported.copy()
        corrected[len(trace) - len(moved) :][jumped] = moved[jumped] / elapsed[jumped]
        return corrected

    def _rows(self, trace: Trace) -> FloatArray:
        """Return the states (T, 14) or, with the one before them, (T + 1, 14)."""
        rows = trace.state[:, :14]
        # The first step of `trace` may be known already: t = 0, or the step at which a time window opens.
        before = [row for row in self.recent if row[0] < rows[0, 0] - TIME_EPSILON_S]
        return np.vstack((before[-1], rows)) if before else rows


def _distances(before: FloatArray, after: FloatArray) -> FloatArray:
    """Return the distances (T,) in m between the positions of states (T, 14)."""
    distances: FloatArray = np.sqrt(np.square(after[:, 1:4] - before[:, 1:4]).sum(axis=1))
    return distances


def _angles(before: FloatArray, after: FloatArray) -> FloatArray:
    return rotation_angles(before[:, 4:8], after[:, 4:8])


def _rpy(row: list[float]) -> tuple[float, float, float]:
    x, y, z, w = row[4:8]
    return geometry.rpy_from_quaternion((x, y, z, w))
