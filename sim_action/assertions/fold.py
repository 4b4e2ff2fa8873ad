"""Margins folded over time: what goals and invariants have in common.

A margin is the distance of a signal to its limit, positive on the good side.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

from sim_action.assertions import State

if TYPE_CHECKING:
    from sim_action.state.trace import FloatArray


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
