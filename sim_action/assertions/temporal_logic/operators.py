"""Parts of a formula, folded over the moments whose future is known; the others wait until it is."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, Protocol, Self

import numpy as np

from sim_action.assertions.monitors import State
from sim_action.assertions.temporal_logic.formula import Formula, Interval, Until, horizon
from sim_action.assertions.temporal_logic.robustness import Cause, cause, robustness
from sim_action.assertions.temporal_logic.samples import Samples
from sim_action.state.trace import FloatArray

# What looks further ahead, in s, would be computed anew with each block over too many moments.
_MOST_LOOKAHEAD: Final = 60.0
TIME_ROUNDING: Final = 1e-9
"""Sim time is step / rate: two ways to the same moment differ by rounding alone."""


def lookahead(*formulas: Formula) -> float:
    """How far formulas look ahead, in s; infinite if they are judged at the end of the run."""
    reach = max(map(horizon, formulas))
    return reach if reach <= _MOST_LOOKAHEAD else math.inf


class Part(Protocol):
    """A formula at the first moment, as far as it is known."""

    @property
    def state(self) -> State:
        """See Monitor.state."""

    @property
    def is_decided(self) -> bool:
        """See DecidingMonitor.is_decided."""

    def observe(self, samples: Samples) -> Part:
        """After the moments that follow."""

    def outcome(self) -> tuple[float, Cause | None]:
        """Its robustness, if nothing more came, and what decides it; infinite if no moment counts."""


@dataclass(frozen=True, slots=True)
class SampleChain:
    """Samples, and those that came before them: to add to it copies nothing."""

    samples: Samples
    earlier: SampleChain | None = None

    def whole(self) -> Samples:
        """All samples in one piece."""
        pieces = [self.samples]
        link = self.earlier
        while link is not None:
            pieces.append(link.samples)
            link = link.earlier
        return Samples.concatenate(pieces[::-1])


@dataclass(frozen=True, slots=True)
class BestMoment:
    """The robustness that decides so far: of which formula, and the samples from its moment on that it depends on."""

    value: float
    formula: Formula
    samples: Samples

    @property
    def cause(self) -> Cause | None:
        """The comparison that decides."""
        return cause(self.formula, self.samples)

    @classmethod
    def at(cls, value: float, formula: Formula, rows: Samples, index: int) -> Self:
        """What was found at a moment of some rows."""
        reach = horizon(formula)
        end = len(rows) if math.isinf(reach) else int(rows.after(float(rows.time[index]) + reach))
        return cls(value, formula, rows.between(index, end))


@dataclass(frozen=True, slots=True)
class Extreme:
    """The least robustness of a formula over an interval (`always`), or the greatest (`eventually`).

    Attributes:
        reach: s that the formula looks ahead; infinite if it is judged at the end of the run.
        begin: s of sim time, the first moment seen.
        open: samples from the first moment on whose future is not known yet.
        found: among the moments whose future is known.
        closed: whether all moments of the interval are such.
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
        """The fold before the first moment."""
        return cls(formula, interval, greatest, lookahead(formula))

    @property
    def state(self) -> State:
        """See Monitor.state: what is judged at the end of the run is neither waited for nor broken before."""
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
    def _is_settled(self) -> bool:
        """Whether one moment has settled it, whatever the others are."""
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
            closed=begin + self.interval.end <= known + TIME_ROUNDING,
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
        """The extreme so far, or a better one among the rows before `end` that lie in the interval."""
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
    open: SampleChain | None = None
    held: BestMoment | None = None
    found: BestMoment | None = None
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
        """See DecidingMonitor.is_decided."""
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
        waiting = SampleChain(rows.between(end, len(rows))) if end < len(rows) else None
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

    def _best(self, rows: Samples, before: FloatArray, then: FloatArray) -> BestMoment | None:
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
        return BestMoment.at(value, self.formula.then, rows, index) if decides else self._least(rows, before[:index])

    def _least(self, rows: Samples, before: FloatArray) -> BestMoment | None:
        """What held the least until now, with the rows that come next."""
        if not len(before):
            return self.held
        index = int(before.argmin())
        if self.held is not None and not before[index] < self.held.value:
            return self.held
        return BestMoment.at(float(before[index]), self.formula.before, rows, index)
