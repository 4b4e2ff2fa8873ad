"""Efforts folded over time: what the monitors of `effort` do."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from sim_action.assertions import State
from sim_action.core import units
from sim_action.state.verdict import Signal, Verdict

if TYPE_CHECKING:
    from sim_action.state.trace import FloatArray, Trace


def magnitude(signal: Callable[[Trace], FloatArray]) -> Callable[[Trace], FloatArray]:
    """The signal, of (T,), without its sign."""
    return lambda trace: np.abs(signal(trace))


@dataclass(frozen=True, slots=True)
class RootMeanSquareMonitor:
    """Adds up the squares of a signal; judged at the end, as later moments may mend it.

    Attributes:
        squares: their sum, over `moments`, the last of which is at sim time `end` in s.
    """

    is_momentary: ClassVar[bool] = False

    name: str
    signal: Callable[[Trace], FloatArray]
    who: str
    unit: str
    limit: float
    squares: float = 0.0
    moments: int = 0
    end: float | None = None

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return State.HOLDS

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        if not len(trace):
            return self
        squares = float(self._squares(trace)[-1])
        return replace(self, squares=squares, moments=self.moments + len(trace), end=float(trace.time[-1]))

    def verdict(self) -> Verdict:
        """Measured is the root mean square so far."""
        if self.end is None:
            return Verdict(True, None, self.limit, None, self.unit, None, "no moment to measure")
        measured = math.sqrt(self.squares / self.moments)
        passed = measured <= self.limit
        value, limit = units.display_apart(measured, self.limit, self.unit)
        message = f"{self.who} {value} RMS until {self.end:.2f} s, {'limit' if passed else 'more than'} {limit}"
        return Verdict(passed, measured, self.limit, self.limit - measured, self.unit, self.end, message)

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Drawn.signals: of all moments up to each, of which the last counts."""
        means = self._squares(trace) / (self.moments + np.arange(1, len(trace) + 1))
        return (Signal(self.name, self.unit, trace.time, np.sqrt(means), upper=self.limit).at_end(),)

    def _squares(self, trace: Trace) -> FloatArray:
        """(T,) their sum up to each moment."""
        # One after the other, from what came before: otherwise it would round differently for every way to cut a trace.
        return np.asarray(np.cumsum(np.concatenate(([self.squares], self.signal(trace) ** 2)))[1:], dtype=np.float64)
