"""Temporal operators as folds: steps whose future is known are judged, the others are kept."""

from __future__ import annotations

import math
from typing import Final, NamedTuple, Protocol, Self

import numpy as np

from sim_action.assertions.monitors import State
from sim_action.assertions.temporal_logic.formula import Formula, Interval, Until, finite_horizon, horizon
from sim_action.assertions.temporal_logic.robustness import Cause, cause, robustness, seen_from, until_operands
from sim_action.assertions.temporal_logic.samples import Samples
from sim_action.core.records import dataclass, replace
from sim_action.state.trace import FloatArray
from sim_action.state.verdict import Judged

_AT_ONCE: Final = Interval(0.0, 0.0)
# A longer lookahead would compute too many steps again with each block.
_MAX_LOOKAHEAD_S: Final = 60.0
TIME_ROUNDING_S: Final = 1e-9
"""Tolerance for sim times in s: they are step / rate, so two computations differ by rounding."""


def lookahead(*formulas: Formula) -> float:
    """Return the lookahead of formulas in s; infinite if they are judged at the end of the run."""
    reach = max(map(horizon, formulas))
    return reach if reach <= _MAX_LOOKAHEAD_S else math.inf


class Outcome(NamedTuple):
    """The result of a formula at the first step, as if the run ended now.

    Attributes:
        value: the robustness; infinite if no step counts.
        cause: the comparison that decides; None if no step counts.
        judged: the steps at which the inner formula could be judged. Without any, nothing was checked.
    """

    value: float
    cause: Cause | None
    judged: Judged


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

    def outcome(self) -> Outcome:
        """Return the result as if the run ended now."""


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
    """The deciding robustness so far, its formula, and the samples that it depends on.

    Attributes:
        contrary, strong: as in `robustness`.
    """

    value: float
    formula: Formula
    samples: Samples
    contrary: bool
    strong: bool

    @property
    def cause(self) -> Cause | None:
        """The comparison that decides."""
        return cause(self.formula, self.samples, contrary=self.contrary, strong=self.strong)

    @property
    def time(self) -> float:
        """The sim time of the step in s."""
        return float(self.samples.time[0])

    @classmethod
    def at(
        cls, value: float, formula: Formula, rows: Samples, index: int, *, contrary: bool = False, strong: bool
    ) -> Self:
        """Return the robustness at one row, with the samples that it depends on."""
        ahead = rows.between(index, seen_from(formula, rows, index))
        return cls(value, formula, ahead, contrary, strong)


def with_judged(judged: Judged, rows: Samples, first: int, margins: FloatArray) -> Judged:
    """Return the judged steps and those from row `first` whose margin is finite: a comparison was evaluated there."""
    indices = np.flatnonzero(np.isfinite(margins))
    if not len(indices):
        return judged
    times = rows.time[first + indices[[0, -1]]]
    return judged.followed_by(len(indices), float(times[0]), float(times[1]))


@dataclass(frozen=True, slots=True)
class Extreme:
    """The least robustness of a formula over an interval (`always`), or the greatest (`eventually`).

    Attributes:
        strong: as in `robustness`.
        reach: lookahead of the formula in s; infinite if it is judged at the end of the run.
        begin: sim time of the first step, in s.
        open: samples whose future is not known yet.
        found: the extreme among the steps whose future is known.
        judged: the judged steps among them.
        closed: True if the future of all steps of the interval is known.
    """

    formula: Formula
    interval: Interval
    greatest: bool
    strong: bool
    reach: float
    begin: float | None = None
    open: SampleChain | None = None
    found: BestMoment | None = None
    judged: Judged = Judged()
    closed: bool = False

    @classmethod
    def of(cls, formula: Formula, interval: Interval, *, greatest: bool) -> Self:
        """Return the fold before the first step. A step is the witness of a goal only with evidence (`strong`)."""
        return cls(formula, interval, greatest, greatest, lookahead(formula))

    @classmethod
    def at_once(cls, formula: Formula) -> Self:
        """Return the fold of a formula that is judged at the first step."""
        return cls(formula, _AT_ONCE, True, False, lookahead(formula))

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
        return self.found is not None and (self.found.value >= 0) == self.greatest

    def observe(self, samples: Samples) -> Self:
        """See Part.observe."""
        if self.closed or not len(samples):
            return self
        begin = float(samples.time[0]) if self.begin is None else self.begin
        later = replace(self, begin=begin)
        if math.isinf(self.reach):
            return replace(later, open=SampleChain(samples, self.open))
        rows = samples if self.open is None else Samples.concatenate((self.open.samples, samples))
        known = float(rows.time[-1]) - self.reach
        end = int(rows.after(known))
        return replace(
            later.folded(rows, end),
            open=SampleChain(rows.between(end, len(rows))) if end < len(rows) else None,
            closed=begin + self.interval.end <= known + TIME_ROUNDING_S,
        )

    def outcome(self) -> Outcome:
        """See Part.outcome."""
        last = self
        if self.open is not None and not self.closed:
            rows = self.open.whole()
            last = self.folded(rows, len(rows))
        if last.found is None:
            return Outcome(-math.inf if self.greatest else math.inf, None, last.judged)
        return Outcome(last.found.value, last.found.cause, last.judged)

    def folded(self, rows: Samples, end: int) -> Self:
        """Return the fold after the rows before `end`."""
        assert self.begin is not None
        first = int(rows.at_or_after(self.begin + self.interval.start))
        last = min(end, int(rows.after(self.begin + self.interval.end)))
        if first >= last:
            return self
        margins = robustness(self.formula, rows.between(first, len(rows)), strong=self.strong)[: last - first]
        judged = with_judged(self.judged, rows, first, margins)
        index = int(margins.argmax() if self.greatest else margins.argmin())
        value = float(margins[index])
        if self.found is not None and not (value > self.found.value if self.greatest else value < self.found.value):
            return replace(self, judged=judged)
        found = BestMoment.at(value, self.formula, rows, first + index, strong=self.strong)
        return replace(self, found=found, judged=judged)


@dataclass(frozen=True, slots=True)
class UntilFold:
    """An `until`: the condition that must hold before, and the best step of the other condition.

    Attributes:
        contrary: True for the negation, an invariant that breaks when the `until` comes true.
        reach: lookahead of both formulas in s.
        begin: sim time of the first step, in s.
        open: samples whose future is not known yet.
        held: the least robustness of `before` over all steps whose future is known.
        found: the best step so far.
        judged: the judged steps of the interval whose future is known.
        closed: True if the future of all steps of the interval is known.
    """

    formula: Until
    contrary: bool
    reach: float
    begin: float | None = None
    open: SampleChain | None = None
    held: BestMoment | None = None
    found: BestMoment | None = None
    judged: Judged = Judged()
    closed: bool = False

    @classmethod
    def of(cls, formula: Until, *, contrary: bool) -> Self:
        """Return the fold before the first step."""
        return cls(formula, contrary, lookahead(formula.before, formula.then))

    @property
    def state(self) -> State:
        """See Monitor.state."""
        came_true = self._came_true
        if self.contrary:
            return State.BROKEN if came_true else State.HOLDS
        return State.HOLDS if came_true else State.BROKEN if self.is_decided else State.PENDING

    @property
    def _came_true(self) -> bool:
        return self.found is not None and self._is_enough(self.found.value)

    @property
    def is_lost(self) -> bool:
        """True if `before` failed, so that no later step can make the `until` true."""
        return self.held is not None and not self._is_enough(self.held.value)

    def _is_enough(self, value: float) -> bool:
        return value > 0 if self.contrary else value >= 0

    @property
    def is_decided(self) -> bool:
        """See DecidingMonitor.is_decided."""
        return self._came_true or self.closed or self.is_lost

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
        later = replace(self, begin=begin).folded(rows, end)
        waiting = SampleChain(rows.between(end, len(rows))) if end < len(rows) else None
        return replace(later, open=waiting, closed=begin + self.formula.interval.end <= known + TIME_ROUNDING_S)

    def outcome(self) -> Outcome:
        """See Part.outcome. A `before` that fails before the interval decides, at one step."""
        last = self
        if self.open is not None and not self.closed:
            last = self.folded(self.open.samples, len(self.open.samples))
        best, judged = last.found, last.judged
        if not judged.moments and last.held is not None and last.is_lost:
            best, judged = last.held, Judged(1, last.held.time, last.held.time)
        value = -math.inf if best is None else best.value
        return Outcome(-value if self.contrary else value, None if best is None else best.cause, judged)

    def folded(self, rows: Samples, end: int) -> Self:
        """Return the fold after the rows before `end`."""
        assert self.begin is not None
        if end == 0:
            return self
        sign = -1 if self.contrary else 1
        before, then = (sign * part[:end] for part in until_operands(self.formula, rows, contrary=self.contrary))
        first = int(rows.at_or_after(self.begin + self.formula.interval.start))
        last = min(end, int(rows.after(self.begin + self.formula.interval.end)))
        held = self._least(rows, before)
        if first >= last:
            return replace(self, held=held)
        carried = math.inf if self.held is None else self.held.value
        least = np.minimum.accumulate(np.concatenate(([carried], before)))[:-1]
        ways = np.minimum(then, least)[first:last]
        judged = with_judged(self.judged, rows, first, ways)
        index = first + int(ways.argmax())
        value = float(ways[index - first])
        if self.found is not None and value <= self.found.value:
            return replace(self, held=held, judged=judged)
        decides = then[index] <= least[index]
        found = self._moment(value, rows, index) if decides else self._least(rows, before[:index])
        return replace(self, held=held, found=found, judged=judged)

    def _moment(self, value: float, rows: Samples, index: int) -> BestMoment:
        strong = not self.contrary
        return BestMoment.at(value, self.formula.then, rows, index, contrary=self.contrary, strong=strong)

    def _least(self, rows: Samples, before: FloatArray) -> BestMoment | None:
        """Return the least robustness of `before`, including the next rows."""
        if not len(before):
            return self.held
        index = int(before.argmin())
        if self.held is not None and not before[index] < self.held.value:
            return self.held
        value = float(before[index])
        return BestMoment.at(value, self.formula.before, rows, index, contrary=self.contrary, strong=True)
