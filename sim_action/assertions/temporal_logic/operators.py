"""Formulas as folds: each is judged at the first step, as far as it is known."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Final, NamedTuple, Self

import numpy as np
from typing_extensions import override

from sim_action.assertions.monitors import Fold, State
from sim_action.assertions.temporal_logic.formula import Formula, Interval, Until, finite_horizon, horizon
from sim_action.assertions.temporal_logic.robustness import Cause, Samples, cause, robustness, seen_from, until_operands
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


class Part(Fold):
    """A formula at the first step, as far as it is known."""

    __slots__ = ()

    @abstractmethod
    def observe(self, samples: Samples) -> Self:
        """Return the part after more steps."""

    @abstractmethod
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
class Operator(Part):
    """The fold of a temporal operator: steps whose future is known are judged, the others are kept.

    Attributes:
        reach: lookahead of the inner formulas in s; infinite if they are judged at the end of the run.
        begin: sim time of the first step, in s.
        open: samples whose future is not known yet.
        found: the best step so far, among those whose future is known.
        judged: the judged steps of the interval among them.
        closed: True if the future of all steps of the interval is known.
    """

    formula: Formula
    reach: float
    begin: float | None = None
    open: SampleChain | None = None
    found: BestMoment | None = None
    judged: Judged = Judged()
    closed: bool = False

    @property
    @abstractmethod
    def window(self) -> Interval:
        """The interval of the operator."""

    @property
    @abstractmethod
    def ahead(self) -> float:
        """The time in s, from the first step on, that it looks ahead at least."""

    @abstractmethod
    def folded(self, rows: Samples, end: int) -> Self:
        """Return the fold after the rows before `end`."""

    @property
    @override
    def needed_until(self) -> float:
        return 0.0 if self.begin is None or self.is_decided else self.begin + self.ahead

    @override
    def observe(self, samples: Samples) -> Self:
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
            closed=begin + self.window.end <= known + TIME_ROUNDING_S,
        )

    def at_end(self) -> Self:
        """Return the fold as if the run ended now."""
        if self.open is None or self.closed:
            return self
        rows = self.open.whole()
        return self.folded(rows, len(rows))

    def rows_inside(self, rows: Samples, end: int) -> tuple[int, int]:
        """Return the index of the first row in the interval, and the end index of those before `end`."""
        assert self.begin is not None
        first = int(rows.at_or_after(self.begin + self.window.start))
        return first, min(end, int(rows.after(self.begin + self.window.end)))


@dataclass(frozen=True, slots=True)
class Extreme(Operator):
    """The least robustness of a formula over an interval (`always`), or the greatest (`eventually`)."""

    interval: Interval = _AT_ONCE
    greatest: bool = True
    # See `robustness`: a step is the witness of a goal only with evidence.
    strong: bool = False

    @classmethod
    def of(cls, formula: Formula, interval: Interval, *, greatest: bool) -> Self:
        """Return the fold before the first step."""
        return cls(formula, lookahead(formula), interval=interval, greatest=greatest, strong=greatest)

    @classmethod
    def at_once(cls, formula: Formula) -> Self:
        """Return the fold of a formula that is judged at the first step."""
        return cls(formula, lookahead(formula))

    @property
    @override
    def window(self) -> Interval:
        return self.interval

    @property
    @override
    def ahead(self) -> float:
        return self.interval.bound + finite_horizon(self.formula)

    @property
    def state(self) -> State:
        """See Fold.state. A formula that is judged at the end of the run counts as holding until then."""
        if self._is_settled:
            return State.HOLDS if self.greatest else State.BROKEN
        if not self.greatest or math.isinf(self.reach):
            return State.HOLDS
        return State.BROKEN if self.closed else State.PENDING

    @property
    @override
    def is_decided(self) -> bool:
        return self.closed or self._is_settled

    @property
    def _is_settled(self) -> bool:
        return self.found is not None and (self.found.value >= 0) == self.greatest

    @override
    def outcome(self) -> Outcome:
        last = self.at_end()
        if last.found is None:
            return Outcome(-math.inf if self.greatest else math.inf, None, last.judged)
        return Outcome(last.found.value, last.found.cause, last.judged)

    @override
    def folded(self, rows: Samples, end: int) -> Self:
        first, last = self.rows_inside(rows, end)
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
class UntilFold(Operator):
    """An `until`: the condition that must hold before, and the best step of the other condition.

    Attributes:
        contrary: True for the negation, an invariant that breaks when the `until` comes true.
        held: the least robustness of `before` over all steps whose future is known.
    """

    formula: Until
    contrary: bool = False
    held: BestMoment | None = None

    @classmethod
    def of(cls, formula: Until, *, contrary: bool) -> Self:
        """Return the fold before the first step."""
        return cls(formula, lookahead(formula.before, formula.then), contrary=contrary)

    @property
    @override
    def window(self) -> Interval:
        return self.formula.interval

    @property
    @override
    def ahead(self) -> float:
        return finite_horizon(self.formula)

    @property
    @override
    def state(self) -> State:
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
    @override
    def is_decided(self) -> bool:
        return self._came_true or self.closed or self.is_lost

    def outcome(self) -> Outcome:
        """See Part.outcome. A `before` that fails before the interval decides, at one step."""
        last = self.at_end()
        best, judged = last.found, last.judged
        if not judged.moments and last.held is not None and last.is_lost:
            best, judged = last.held, Judged(1, last.held.time, last.held.time)
        value = -math.inf if best is None else best.value
        return Outcome(-value if self.contrary else value, None if best is None else best.cause, judged)

    @override
    def folded(self, rows: Samples, end: int) -> Self:
        if end == 0:
            return self
        sign = -1 if self.contrary else 1
        before, then = (sign * part[:end] for part in until_operands(self.formula, rows, contrary=self.contrary))
        first, last = self.rows_inside(rows, end)
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
