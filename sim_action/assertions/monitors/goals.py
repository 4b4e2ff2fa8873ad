"""Margins folded over time: what goals and invariants have in common.

A margin is the distance of a signal to its limit, positive on the good side.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Self

from sim_action.assertions.monitors import State
from sim_action.core import units
from sim_action.state.verdict import Signal, Verdict

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from sim_action.state.trace import FloatArray


# Sim time is step / rate: the same span is not the same number everywhere.
_DIGITS: Final = 9


@dataclass(frozen=True, slots=True)
class Goal:
    """Comes true at the first moment whose margin is not negative; until then the best moment is kept."""

    margin: float | None = None
    time: float | None = None
    state: State = State.PENDING

    def observe(self, time: FloatArray, margin: FloatArray) -> Self:
        """The fold after these moments."""
        if self.state is State.HOLDS or not len(time):
            return self
        met = margin >= 0
        index = int(met.argmax()) if met.any() else int(margin.argmax())
        best = float(margin[index])
        if met[index]:
            return replace(self, margin=best, time=float(time[index]), state=State.HOLDS)
        if self.margin is None or best > self.margin:
            return replace(self, margin=best, time=float(time[index]))
        return self


@dataclass(frozen=True, slots=True)
class Invariant:
    """Is broken at the first moment whose margin is negative; until then the worst moment is kept."""

    margin: float | None = None
    time: float | None = None
    state: State = State.HOLDS

    def observe(self, time: FloatArray, margin: FloatArray) -> Self:
        """The fold after these moments."""
        if self.state is State.BROKEN or not len(time):
            return self
        broken = ~(margin >= 0)  # what is not a number does not hold
        index = int(broken.argmax()) if broken.any() else int(margin.argmin())
        worst = float(margin[index])
        if broken[index]:
            return replace(self, margin=worst, time=float(time[index]), state=State.BROKEN)
        if self.margin is None or worst < self.margin:
            return replace(self, margin=worst, time=float(time[index]))
        return self


def joined(*states: State) -> State:
    """The state of several folds that must all be well."""
    for state in (State.BROKEN, State.PENDING):
        if state in states:
            return state
    return State.HOLDS


def joined_by_any(parts: Iterable[tuple[State, bool]]) -> State:
    """The state of several folds of which one must be well; each with whether it is decided.

    One that is not broken so far does not do, while another is waited for: it may break, and the other come true.
    """
    known = tuple(parts)
    if any(state is State.HOLDS and decided for state, decided in known):
        return State.HOLDS
    states = {state for state, _ in known}
    return State.BROKEN if states == {State.BROKEN} else State.PENDING if State.PENDING in states else State.HOLDS


@dataclass(frozen=True, slots=True)
class ClosestApproach:
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


@dataclass(frozen=True, slots=True)
class HoldTime:
    """The fold of how long a condition has held, until it has for as long as is wanted.

    Attributes:
        wanted: s.
        since: sim time in s from which it holds, at the last moment seen; None if it does not.
        goal: its margin is that of the longest stretch, its time that stretch's end.
    """

    wanted: float
    since: float | None = None
    goal: Goal = Goal()

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return self.goal.state

    @property
    def longest(self) -> float:
        """How long it held, in s; 0 if it never did."""
        return max(0.0, self.wanted + (-math.inf if self.goal.margin is None else self.goal.margin))

    @property
    def began(self) -> float:
        """When the longest stretch began, in s of sim time; it is meant for where there is one."""
        return (self.goal.time or 0.0) - self.longest

    def observe(self, time: FloatArray, holds: NDArray[np.bool_]) -> Self:
        """The fold after these moments, `holds` being (T,)."""
        import numpy as np

        if not len(time):
            return self
        since = self._since(time, holds)
        margin = np.where(holds, np.round(time - since - self.wanted, _DIGITS) + 0.0, -math.inf)
        goal = self.goal.observe(time, margin)
        return replace(self, since=float(since[-1]) if holds[-1] else None, goal=goal)

    def lasting(self, time: FloatArray, holds: NDArray[np.bool_]) -> FloatArray:
        """(T,) s that it has held at each of these moments; 0 where it does not."""
        import numpy as np

        return np.where(holds, np.round(time - self._since(time, holds), _DIGITS), 0.0)

    def _since(self, time: FloatArray, holds: NDArray[np.bool_]) -> FloatArray:
        """(T,) s of sim time from which it holds, where it does."""
        import numpy as np

        held_before = np.concatenate(([self.since is not None], holds[:-1]))
        begins = np.where(holds & ~held_before, time, -math.inf)
        first = begins[0] if self.since is None else self.since
        return np.asarray(np.maximum.accumulate(np.concatenate(([first], begins[1:]))), dtype=np.float64)
