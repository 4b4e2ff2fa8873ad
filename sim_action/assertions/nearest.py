"""How near something came to where it should get: a goal, and what to say of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

from sim_action.assertions import State
from sim_action.assertions.fold import Goal
from sim_action.core import units
from sim_action.state.verdict import Signal, Verdict

if TYPE_CHECKING:
    from sim_action.state.trace import FloatArray


@dataclass(frozen=True, slots=True)
class Nearest:
    """The fold of a distance and, where it is asked for, of a heading's error, each against its tolerance.

    Folds the worse of both, as a part of its tolerance; keeps what they were at the best moment.

    Attributes:
        who: begins the message: "elbow came".
        place: where it should get, for the message.
        unit: SI symbol of the distance.
        yaw_tolerance: rad.
        end: sim time in s of the last moment seen.
    """

    who: str
    place: str
    unit: str
    tolerance: float
    yaw_tolerance: float = math.inf
    goal: Goal = Goal()
    distance: float = math.inf
    yaw_error: float | None = None
    end: float = 0.0

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return self.goal.state

    def observe(self, time: FloatArray, distance: FloatArray, yaw_error: FloatArray | None = None) -> Self:
        """The fold after these moments; distance in `unit`, yaw_error in rad, each (T,)."""
        if not len(time):
            return self
        margin = self.tolerance - distance
        if yaw_error is not None:
            scale = self.tolerance / self.yaw_tolerance
            margin = margin.clip(max=(self.yaw_tolerance - yaw_error) * scale)
        later = replace(self, goal=self.goal.observe(time, margin), end=float(time[-1]))
        if later.goal is self.goal:
            return later
        best = int((time == later.goal.time).argmax())
        error = None if yaw_error is None else float(yaw_error[best])
        return replace(later, distance=float(distance[best]), yaw_error=error)

    def drawn(
        self, name: str, time: FloatArray, distance: FloatArray, yaw_error: FloatArray | None = None
    ) -> tuple[Signal, ...]:
        """The curves of what is folded, each against its tolerance."""
        curve = Signal(name, self.unit, time, distance, upper=self.tolerance)
        if yaw_error is None:
            return (curve,)
        return (curve, Signal("heading error", "rad", time, yaw_error, upper=self.yaw_tolerance))

    def verdict(self) -> Verdict:
        """Measured and limit are distances; the margin also accounts for the heading."""
        passed = self.state is State.HOLDS
        if self.goal.time is None:
            return Verdict(False, None, self.tolerance, None, self.unit, None, "no moment to measure")
        # Apart from the tolerance, which the title of the expectation shows beside the message.
        near, _ = units.display_apart(self.distance, self.tolerance, self.unit)
        facing = self._facing()
        message = (
            f"{self.who} within {near} of {self.place}{facing} in {self.goal.time:.2f} s"
            if passed
            else f"{self.who} no nearer than {near} to {self.place}{facing} in {self.end:.1f} s; nearest at "
            f"{self.goal.time:.2f} s"
        )
        return Verdict(passed, self.distance, self.tolerance, self.goal.margin, self.unit, self.goal.time, message)

    def _facing(self) -> str:
        if self.yaw_error is None:
            return ""
        off, _ = units.display_apart(self.yaw_error, self.yaw_tolerance, "rad")
        return f", {off} off its heading,"
