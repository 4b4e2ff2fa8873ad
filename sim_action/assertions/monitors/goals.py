"""Goals and invariants as folds of a margin over time.

A margin is the distance of a signal to its limit. It is positive on the allowed side.
"""

from __future__ import annotations

import math
from typing import ClassVar, Self

from sim_action.assertions.monitors import State, Truth
from sim_action.core import units
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass, replace
from sim_action.state.verdict import Signal, Verdict


@dataclass(frozen=True, slots=True)
class MarginFold:
    """The fold of a margin: it ends at the first step that decides. Until then it keeps the extreme step."""

    ends_as: ClassVar[State]

    # margin, time: of the step that decides, or of the extreme step; None before the first one. The time is in s.
    margin: float | None = None
    time: float | None = None
    state: State = State.PENDING

    def observe(self, time: FloatArray, margin: FloatArray) -> Self:
        """Return the fold after these steps; `time` in s and `margin`, each (T,)."""
        if self.state is self.ends_as or not len(time):
            return self
        is_goal = self.ends_as is State.HOLDS
        decides = margin >= 0 if is_goal else ~(margin >= 0)  # NaN breaks an invariant
        if decides.any():
            index = int(decides.argmax())
            return replace(self, margin=float(margin[index]), time=float(time[index]), state=self.ends_as)
        index = int(margin.argmax() if is_goal else margin.argmin())
        extreme = float(margin[index])
        if self.margin is None or (extreme > self.margin if is_goal else extreme < self.margin):
            return replace(self, margin=extreme, time=float(time[index]))
        return self


@dataclass(frozen=True, slots=True)
class Goal(MarginFold):
    """The fold of a goal: it comes true at the first margin >= 0. Until then it keeps the best step."""

    ends_as: ClassVar[State] = State.HOLDS


@dataclass(frozen=True, slots=True)
class Invariant(MarginFold):
    """The fold of an invariant: it breaks at the first margin < 0. Until then it keeps the worst step."""

    ends_as: ClassVar[State] = State.BROKEN

    state: State = State.HOLDS


def joined(*states: State) -> State:
    """Return the state of several monitors that must all hold."""
    for state in (State.BROKEN, State.PENDING):
        if state in states:
            return state
    return State.HOLDS


@dataclass(frozen=True, slots=True)
class ClosestApproach:
    """A goal: a distance, and optionally the error of an angle, come within their tolerances.

    The margin is that of the quantity that is worse relative to its tolerance.
    """

    who: str  # the beginning of the message, such as "elbow came"
    place: str  # the target, for the message
    unit: str  # SI symbol of the distance
    tolerance: float
    angle_tolerance: float = math.inf  # tolerance of the angle in rad
    angle: str = "heading"  # the name of the angle, "heading" or "orientation"
    goal: Goal = Goal()
    distance: float = math.inf  # distance, angle_error: the values at the best step
    angle_error: float | None = None
    end: float = 0.0  # sim time of the last step, in s

    @property
    def state(self) -> State:
        """The state of the goal."""
        return self.goal.state

    def observe(self, time: FloatArray, distance: FloatArray, angle_error: FloatArray | None = None) -> Self:
        """Return the fold after these steps; `distance` in `unit`, `angle_error` in rad, each (T,)."""
        if not len(time):
            return self
        margin = self.tolerance - distance
        if angle_error is not None:
            scale = self.tolerance / self.angle_tolerance
            margin = margin.clip(max=(self.angle_tolerance - angle_error) * scale)
        later = replace(self, goal=self.goal.observe(time, margin), end=float(time[-1]))
        if later.goal is self.goal:
            return later
        best = int((time == later.goal.time).argmax())
        error = None if angle_error is None else float(angle_error[best])
        return replace(later, distance=float(distance[best]), angle_error=error)

    def truth(self, time: FloatArray, distance: FloatArray, angle_error: FloatArray | None = None) -> Truth:
        """Return True where both errors are within their tolerances."""
        near = self.tolerance - distance >= 0
        return Truth(time, near if angle_error is None else near & (angle_error <= self.angle_tolerance))

    def drawn(
        self, name: str, time: FloatArray, distance: FloatArray, angle_error: FloatArray | None = None
    ) -> tuple[Signal, ...]:
        """Return the curves of the distance and the error of the angle, each with its tolerance."""
        curve = Signal(name, self.unit, time, distance, upper=self.tolerance)
        if angle_error is None:
            return (curve,)
        return (curve, Signal(f"{self.angle} error", "rad", time, angle_error, upper=self.angle_tolerance))

    def verdict(self) -> Verdict:
        """Return the verdict. `measured` and `limit` are distances; the margin includes the angle."""
        passed = self.state is State.HOLDS
        if self.goal.time is None:
            return Verdict(False, None, self.tolerance, None, self.unit, None, "no physics step to measure")
        # With enough digits to differ from the tolerance, which the title shows next to the message.
        near, _ = units.display_apart(self.distance, self.tolerance, self.unit)
        facing = self._facing()
        message = (
            f"{self.who} within {near} of {self.place}{facing} in {self.goal.time:.2f} s"
            if passed
            else f"{self.who} no closer than {near} to {self.place}{facing} in {self.end:.1f} s; closest at "
            f"{self.goal.time:.2f} s"
        )
        return Verdict(passed, self.distance, self.tolerance, self.goal.margin, self.unit, self.goal.time, message)

    def _facing(self) -> str:
        if self.angle_error is None:
            return ""
        off, _ = units.display_apart(self.angle_error, self.angle_tolerance, "rad")
        return f", {off} off its {self.angle},"
