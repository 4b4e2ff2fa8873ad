"""`until` as the outermost operator: a goal, which is broken by what does not hold before it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from sim_action.assertions import State
from sim_action.assertions.stl_parts import TIME_ROUNDING, Chain, Found, lookahead
from sim_action.assertions.temporal_logic.formula import Until
from sim_action.assertions.temporal_logic.robustness import Cause, robustness
from sim_action.assertions.temporal_logic.samples import Samples
from sim_action.state.trace import FloatArray


@dataclass(frozen=True, slots=True)
class UntilFold:
    """What must hold before, so far, and the best moment at which the other thing holds.

    Attributes:
        reach: s that the two formulas look ahead.
        strict: whether a robustness of 0 is not enough: it is for the contrary.
        begin: s of sim time, the first moment seen.
        open: samples whose future is not known yet.
        held: the least robustness of what must hold before, at all moments whose future is known.
        found: the best of these moments.
        closed: whether all moments of the interval are among them.
    """

    formula: Until
    reach: float
    strict: bool
    begin: float | None = None
    open: Chain | None = None
    held: Found | None = None
    found: Found | None = None
    closed: bool = False

    @classmethod
    def of(cls, formula: Until, *, strict: bool) -> Self:
        """The fold before the first moment."""
        return cls(formula, lookahead(formula.before, formula.then), strict)

    @property
    def state(self) -> State:
        """See Monitor.state."""
        if self.found is not None and self._is_enough(self.found.value):
            return State.HOLDS
        too_late = self.held is not None and not self._is_enough(self.held.value)
        return State.BROKEN if self.closed or too_late else State.PENDING

    def _is_enough(self, value: float) -> bool:
        return value > 0 if self.strict else value >= 0

    @property
    def is_decided(self) -> bool:
        """See Decisive.is_decided."""
        return self.state is not State.PENDING

    def observe(self, samples: Samples) -> Self:
        """See Part.observe."""
        if self.closed or not len(samples):
            return self
        begin = float(samples.time[0]) if self.begin is None else self.begin
        rows = samples if self.open is None else Samples.concatenate((self.open.samples, samples))
        known = float(rows.time[-1]) - self.reach
        end = int(rows.after(known))
        later = replace(self, begin=begin)._after(rows, end)  # noqa: SLF001 - its own
        waiting = Chain(rows.between(end, len(rows))) if end < len(rows) else None
        return replace(later, open=waiting, closed=begin + self.formula.interval.end <= known + TIME_ROUNDING)

    def outcome(self) -> tuple[float, Cause | None]:
        """See Part.outcome."""
        last = self
        if self.open is not None and not self.closed:
            last = self._after(self.open.samples, len(self.open.samples))
        return (-math.inf, None) if last.found is None else (last.found.value, last.found.cause)

    def _after(self, rows: Samples, end: int) -> Self:
        """The fold after the rows before `end`."""
        if end == 0:
            return self
        before, then = (robustness(part, rows)[:end] for part in (self.formula.before, self.formula.then))
        found = self._best(rows, before, then)
        return replace(self, held=self._least(rows, before), found=found)

    def _best(self, rows: Samples, before: FloatArray, then: FloatArray) -> Found | None:
        """The best moment of the interval until now, with the rows that come next."""
        assert self.begin is not None
        first = int(rows.at_or_after(self.begin + self.formula.interval.start))
        last = min(len(then), int(rows.after(self.begin + self.formula.interval.end)))
        if first >= last:
            return self.found
        carried = math.inf if self.held is None else self.held.value
        held = np.minimum.accumulate(np.concatenate(([carried], before)))
        ways = np.minimum(then, held[:-1])[first:last]
        index = first + int(ways.argmax())
        value = float(ways[index - first])
        if self.found is not None and value <= self.found.value:
            return self.found
        decides = then[index] <= held[index]
        return Found.at(value, self.formula.then, rows, index) if decides else self._least(rows, before[:index])

    def _least(self, rows: Samples, before: FloatArray) -> Found | None:
        """What held the least until now, with the rows that come next."""
        if not len(before):
            return self.held
        index = int(before.argmin())
        if self.held is not None and not before[index] < self.held.value:
            return self.held
        return Found.at(float(before[index]), self.formula.before, rows, index)
