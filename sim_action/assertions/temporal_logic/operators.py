"""Temporal operators as folds: steps whose future is known are judged, the others are kept."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, Protocol, Self

import numpy as np

from sim_action.assertions.monitors import State
from sim_action.assertions.temporal_logic.formula import Formula, Interval, Until, finite_horizon, horizon
from sim_action.assertions.temporal_logic.robustness import Cause, cause, robustness
from sim_action.assertions.temporal_logic.samples import Samples
from sim_action.state.trace import FloatArray

# A longer lookahead would compute too many steps again with each block.
_MAX_LOOKAHEAD_S: Final = 60.0
TIME_ROUNDING_S: Final = 1e-9
"""Tolerance for sim times in s: they are step / rate, so two computations differ by rounding."""


def lookahead(*formulas: Formula) -> float:
    """Return the lookahead of formulas in s; infinite if they are judged at the end of the run."""
    reach = max(map(horizon, formulas))
    return reach if reach <= _MAX_LOOKAHEAD_S else math.inf


class Part(Protocol):
    """A formula at the first step, as far as it is known."""

    @property
    def state(self) -> State:
        """See Monitor.state."""

    @property
    def is_decided(self) -> bool:
        """See DecidingMonitor.is_decided."""

    @property
    def needed_until(self) -> float:
        """See BoundedMonitor.needed_until."""

    def observe(self, samples: Samples) -> Part:
        """Return the part after more steps."""

    def outcome(self) -> tuple[float, Cause | None]:
        """Return the robustness as if the run ended now, and its cause; infinite if no step counts."""


@dataclass(frozen=True, slots=True)
class SampleChain:
    """Samples linked to the samples before them, so that adding more copies nothing."""

    samples: Samples
    earlier: SampleChain | None = None

    def whole(self) -> Samples:
        """Return all samples in one piece."""
        pieces = [self.samples]
        link = self.earlier
        while link is not None:
            pieces.append(link.samples)
            link = link.earlier
        return Samples.concatenate(pieces[::-1])


@dataclass(frozen=True, slots=True)
class BestMoment:
    """The deciding robustness so far, its formula, and the samples that it depends on."""

    value: float
    formula: Formula
    samples: Samples

    @property
    def cause(self) -> Cause | None:
        """The comparison that decides."""
        return cause(self.formula, self.samples)

    @classmethod
    def at(cls, value: float, formula: Formula, rows: Samples, index: int) -> Self:
        """Return the robustness at one row, with the samples that it depends on."""
        reach = horizon(formula)
        end = len(rows) if math.isinf(reach) else int(rows.after(float(rows.time[index]) + reach))
        return cls(value, formula, rows.between(index, end))


@dataclass(frozen=True, slots=True)
class Extreme:
    """The least robustness of a formula over an interval (`always`), or the greatest (`eventually`).

    Attributes:
        reach: lookahead of the formula in s; infinite if it is judged at the end of the run.
        begin: sim time of the first step, in s.
        open: samples whose future is not known yet.
        found: the extreme among the steps whose future is known.
        closed: True if the future of all steps of the interval is known.
    """

    formula: Formula
    interval: Interval
    greatest: bool
    reach: float
    begin: float | None = None
    open: SampleChain | None = None
    found: BestMoment | None = None
    closed: bool = False

    @classmethod
    def of(cls, formula: Formula, interval: Interval, *, greatest: bool) -> Self:
        """Return the fold before the first step."""
        return cls(formula, interval, greatest, lookahead(formula))

    @property
    def state(self) -> State:
        """See Monitor.state. A formula that is judged at the end of the run counts as holding until then."""
        if self._is_settled:
            return State.HOLDS if self.greatest else State.BROKEN
        if not self.greatest or math.isinf(self.reach):
            return State.HOLDS
        return State.BROKEN if self.closed else State.PENDING

    @property
    def is_decided(self) -> bool:
        """See DecidingMonitor.is_decided."""
        return self.closed or self._is_settled

    @property
    def needed_until(self) -> float:
        """See BoundedMonitor.needed_until."""
        if self.begin is None or self.is_decided:
            return 0.0
        return self.begin + self.interval.bound + finite_horizon(self.formula)

    @property
    def _is_settled(self) -> bool:
        """True if one step has decided the result."""
        return self.found is not None and (self.found.value >= 0) == self.greatest

    def observe(self, samples: Samples) -> Self:
        """See Part.observe."""
        if self.closed or not len(samples):
            return self
        begin = float(samples.time[0]) if self.begin is None else self.begin
        if math.isinf(self.reach):
            return replace(self, begin=begin, open=SampleChain(samples, self.open))
        later = replace(self, begin=begin)
        rows = samples if self.open is None else Samples.concatenate((self.open.samples, samples))
        known = float(rows.time[-1]) - self.reach
        end = int(rows.after(known))
        return replace(
            later,
            open=SampleChain(rows.between(end, len(rows))) if end < len(rows) else None,
            found=later._best(rows, end),  # noqa: SLF001 - its own
            closed=begin + self.interval.end <= known + TIME_ROUNDING_S,
        )

    def outcome(self) -> tuple[float, Cause | None]:
        """See Part.outcome."""
        found = self.found
        if self.open is not None and not self.closed:
            rows = self.open.whole()
            found = self._best(rows, len(rows))
        if found is None:
            return -math.inf if self.greatest else math.inf, None
        return found.value, found.cause

    def _best(self, rows: Samples, end: int) -> BestMoment | None:
        """Return the extreme including the rows before `end` that lie in the interval."""
        assert self.begin is not None
        first = int(rows.at_or_after(self.begin + self.interval.start))
        last = min(end, int(rows.after(self.begin + self.interval.end)))
        if first >= last:
            return self.found
        margins = robustness(self.formula, rows.between(first, len(rows)))[: last - first]
        index = int(margins.argmax() if self.greatest else margins.argmin())
        value = float(margins[index])
        if self.found is not None and not (value > self.found.value if self.greatest else value < self.found.value):
            return self.found
        return BestMoment.at(value, self.formula, rows, first + index)


@dataclass(frozen=True, slots=True)
class UntilFold:
    """An `until`: the condition that must hold before, and the best step of the other condition.

    Attributes:
        reach: lookahead of both formulas in s.
        strict: True if a robustness of 0 does not hold; used for the negation.
        begin: sim time of the first step, in s.
        open: samples whose future is not known yet.
        held: the least robustness of `before` over all steps whose future is known.
        found: the best step so far.
        closed: True if the future of all steps of the interval is known.
    """

    formula: Until
    reach: float
    strict: bool
    begin: float | None = None
    open: SampleChain | None = None
    held: BestMoment | None = None
    found: BestMoment | None = None
    closed: bool = False

    @classmethod
    def of(cls, formula: Until, *, strict: bool) -> Self:
        """Return the fold before the first step."""
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
        """See DecidingMonitor.is_decided."""
        return self.state is not State.PENDING

    @property
    def needed_until(self) -> float:
        """See BoundedMonitor.needed_until."""
        if self.begin is None or self.is_decided:
            return 0.0
        return self.begin + finite_horizon(self.formula)

    def observe(self, samples: Samples) -> Self:
        """See Part.observe."""
        if self.closed or not len(samples):
            return self
        begin = float(samples.time[0]) if self.begin is None else self.begin
        rows = samples if self.open is None else Samples.concatenate((self.open.samples, samples))
        known = float(rows.time[-1]) - self.reach
        end = int(rows.after(known))
        later = replace(self, begin=begin)._after(rows, end)  # noqa: SLF001 - its own
        waiting = SampleChain(rows.between(end, len(rows))) if end < len(rows) else None
        return replace(later, open=waiting, closed=begin + self.formula.interval.end <= known + TIME_ROUNDING_S)

    def outcome(self) -> tuple[float, Cause | None]:
        """See Part.outcome."""
        last = self
        if self.open is not None and not self.closed:
            last = self._after(self.open.samples, len(self.open.samples))
        return (-math.inf, None) if last.found is None else (last.found.value, last.found.cause)

    def _after(self, rows: Samples, end: int) -> Self:
        """Return the fold after the rows before `end`."""
        if end == 0:
            return self
        before, then = (robustness(part, rows)[:end] for part in (self.formula.before, self.formula.then))
        found = self._best(rows, before, then)
        return replace(self, held=self._least(rows, before), found=found)

    def _best(self, rows: Samples, before: FloatArray, then: FloatArray) -> BestMoment | None:
        """Return the best step of the interval, including the next rows."""
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
        return BestMoment.at(value, self.formula.then, rows, index) if decides else self._least(rows, before[:index])

    def _least(self, rows: Samples, before: FloatArray) -> BestMoment | None:
        """Return the least robustness of `before`, including the next rows."""
        if not len(before):
            return self.held
        index = int(before.argmin())
        if self.held is not None and not before[index] < self.held.value:
            return self.held
        return BestMoment.at(float(before[index]), self.formula.before, rows, index)
