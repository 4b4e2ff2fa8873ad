"""The monitor of a formula. Its outermost operators become goals and invariants; inner operators look ahead."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar, Final, NamedTuple, Self

import numpy as np
from typing_extensions import override

from sim_action.assertions.monitors import Fold, Monitor, State
from sim_action.assertions.temporal_logic import formula as stl
from sim_action.assertions.temporal_logic.combination import Junction
from sim_action.assertions.temporal_logic.formula import Formula, Interval, parts, signals, signed_parts
from sim_action.assertions.temporal_logic.formula_claims import premises
from sim_action.assertions.temporal_logic.robustness import (
    Cause,
    Samples,
    SignalReader,
    cause,
    robustness,
    seen_from,
    until_operands,
    values,
)
from sim_action.core import units
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass, delegated, replace
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.verdict import Judged, Verdict
from sim_action.state.verdict import Signal as Curve
from sim_action.world.scene import Scene

_MAX_POINTS: Final = 60  # a formula that is judged at the end is computed again for each point of the curve
_AT_ONCE: Final = Interval(0.0, 0.0)
# A longer lookahead would compute too many steps again with each block.
_MAX_LOOKAHEAD_S: Final = 60.0
TIME_ROUNDING_S: Final = 1e-9
"""Tolerance for sim times in s: they are step / rate, so two computations differ by rounding."""


def lookahead(*formulas: Formula) -> float:
    """Return the lookahead of formulas in s; infinite if they are judged at the end of the run."""
    reach = max(map(stl.horizon, formulas))
    return reach if reach <= _MAX_LOOKAHEAD_S else math.inf


class Outcome(NamedTuple):
    """The result of a formula at the first step, as if the run ended now."""

    value: float  # the robustness; infinite if no step counts
    cause: Cause | None  # the comparison that decides; None if no step counts
    judged: Judged  # the steps at which the inner formula could be judged. Without any, nothing was checked.


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
    """The deciding robustness so far, its formula, and the samples that it depends on."""

    value: float
    formula: Formula
    samples: Samples
    contrary: bool  # contrary, strong: as in `robustness`
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
    return judged.followed_by(rows.time[first + np.flatnonzero(np.isfinite(margins))])


@dataclass(frozen=True, slots=True)
class Operator(Part):
    """The fold of a temporal operator: steps whose future is known are judged, the others are kept."""

    formula: Formula
    interval: Interval
    ahead: float  # the time in s, from the first step on, that it looks ahead at least
    reach: float  # lookahead of the inner formulas in s; infinite if they are judged at the end of the run
    begin: float | None = None  # sim time of the first step, in s
    open: SampleChain | None = None  # samples whose future is not known yet
    best: BestMoment | None = None  # the best step so far, among those whose future is known
    judged: Judged = Judged()  # the judged steps of the interval among them
    closed: bool = False  # True if the future of all steps of the interval is known

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
        decided_until = float(rows.time[-1]) - self.reach
        end = int(rows.after(decided_until))
        return replace(
            later.folded(rows, end),
            open=SampleChain(rows.between(end, len(rows))) if end < len(rows) else None,
            closed=begin + self.interval.end <= decided_until + TIME_ROUNDING_S,
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
        first = int(rows.at_or_after(self.begin + self.interval.start))
        return first, min(end, int(rows.after(self.begin + self.interval.end)))


@dataclass(frozen=True, slots=True)
class Extreme(Operator):
    """The least robustness of a formula over an interval (`always`), or the greatest (`eventually`)."""

    greatest: bool = True
    strong: bool = False  # see `robustness`: a step is the witness of a goal only with evidence

    @classmethod
    def of(cls, formula: Formula, interval: Interval, *, greatest: bool) -> Self:
        """Return the fold before the first step."""
        ahead = interval.bound + stl.finite_horizon(formula)
        return cls(formula, interval, ahead, lookahead(formula), greatest=greatest, strong=greatest)

    @classmethod
    def at_once(cls, formula: Formula) -> Self:
        """Return the fold of a formula that is judged at the first step."""
        return cls(formula, _AT_ONCE, stl.finite_horizon(formula), lookahead(formula))

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
        return self.best is not None and (self.best.value >= 0) == self.greatest

    @override
    def outcome(self) -> Outcome:
        last = self.at_end()
        if last.best is None:
            return Outcome(-math.inf if self.greatest else math.inf, None, last.judged)
        return Outcome(last.best.value, last.best.cause, last.judged)

    @override
    def folded(self, rows: Samples, end: int) -> Self:
        first, last = self.rows_inside(rows, end)
        if first >= last:
            return self
        margins = robustness(self.formula, rows.between(first, len(rows)), strong=self.strong)[: last - first]
        judged = with_judged(self.judged, rows, first, margins)
        index = int(margins.argmax() if self.greatest else margins.argmin())
        value = float(margins[index])
        if self.best is not None and not (value > self.best.value if self.greatest else value < self.best.value):
            return replace(self, judged=judged)
        best = BestMoment.at(value, self.formula, rows, first + index, strong=self.strong)
        return replace(self, best=best, judged=judged)


@dataclass(frozen=True, slots=True)
class UntilFold(Operator):
    """An `until`: the condition that must hold before, and the best step of the other condition."""

    formula: stl.Until
    contrary: bool = False  # True for the negation, an invariant that breaks when the `until` comes true
    held: BestMoment | None = None  # the least robustness of `before` over all steps whose future is known

    @classmethod
    def of(cls, formula: stl.Until, *, contrary: bool) -> Self:
        """Return the fold before the first step."""
        reach = lookahead(formula.before, formula.then)
        return cls(formula, formula.interval, stl.finite_horizon(formula), reach, contrary=contrary)

    @property
    @override
    def state(self) -> State:
        came_true = self._came_true
        if self.contrary:
            return State.BROKEN if came_true else State.HOLDS
        return State.HOLDS if came_true else State.BROKEN if self.is_decided else State.PENDING

    @property
    def _came_true(self) -> bool:
        return self.best is not None and self._is_enough(self.best.value)

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
        best, judged = last.best, last.judged
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
        if self.best is not None and value <= self.best.value:
            return replace(self, held=held, judged=judged)
        decides = then[index] <= least[index]
        best = self._moment(value, rows, index) if decides else self._least(rows, before[:index])
        return replace(self, held=held, best=best, judged=judged)

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


@dataclass(frozen=True, slots=True)
class StlMonitor(Monitor):
    """The monitor of a whole formula."""

    formula: Formula
    part: Part
    reader: SignalReader  # the reader of the signals, after the steps so far
    units: Mapping[stl.Comparison, str]  # the SI symbol of the margin of each comparison
    # each premise of an implication as text, and the search for a moment at which it holds
    premises: tuple[tuple[str, Extreme], ...] = ()
    # first, last: the sim times in s of the first and the last step; None before the first one
    first: float | None = None
    last: float | None = None

    @classmethod
    def of(
        cls, formula: Formula, comparison_units: Mapping[stl.Comparison, str], scene: Scene, start: Observation
    ) -> Self:
        """Return the monitor before the first step; `start` is the state at t = 0."""
        extremes = tuple(
            (premise.text, Extreme.of(premise.formula, premise.interval, greatest=True))
            for premise in premises(formula)
        )
        reader = SignalReader.of(stl.signals_of(formula), scene, start)
        return cls(formula, open_formula(formula), reader, comparison_units, extremes)

    def begin(self, trace: Trace) -> Self:
        """See Monitor.begin. Contact forces are means over the last steps, and readings last."""
        return replace(self, reader=self.reader.begun(trace))

    state: ClassVar[State] = delegated("part.state")
    is_decided: ClassVar[bool] = delegated("part.is_decided")
    needed_until: ClassVar[float] = delegated("part.needed_until")

    @override
    def observe(self, trace: Trace) -> Self:
        if not len(trace):
            return self
        samples = self.reader.read(trace)
        reader = self.reader.after(trace)
        if not len(samples):
            return replace(self, reader=reader, last=float(trace.time[-1]))
        observed = tuple(
            (text, extreme if extreme.is_decided else extreme.observe(samples)) for text, extreme in self.premises
        )
        first = float(samples.time[0]) if self.first is None else self.first
        part = self.part.observe(samples)
        last = float(trace.time[-1])
        return replace(self, part=part, reader=reader, premises=observed, first=first, last=last)

    @property
    @override
    def unmet_premises(self) -> tuple[str, ...]:
        return tuple(text for text, premise in self.premises if premise.outcome()[0] < 0)

    def signals(self, trace: Trace) -> tuple[Curve, ...]:
        """See Monitor.signals. Returns the compared quantities and the robustness."""
        samples = self.reader.read(trace)
        distinct_units = set(self.units.values())
        if not len(samples):
            return ()
        robustness = robustness_so_far(self.part, samples, distinct_units.pop() if len(distinct_units) == 1 else "")
        return (*compared(self.formula, samples, self.units), robustness)

    def verdict(self) -> Verdict:
        """Return the verdict: both sides of the deciding comparison, and the robustness as the margin."""
        if self.last is not None and self.first is None:
            return Verdict(passed=False, message=f"never checked: {self._unknown()}", judged=Judged())
        if self.first is None or self.last is None:
            return Verdict(passed=False, message="no physics step to measure", judged=Judged())
        value, decisive, judged = self.part.outcome()
        passed = value >= 0 and judged.moments > 0
        if decisive is None:
            message = _about_evidence(self.formula, self.first, self.last, judged)
            return Verdict(passed, message=message, judged=judged)
        unit = self.units[decisive.comparison]
        measured, limit, message = _decision(decisive, unit)
        return Verdict(passed, measured, limit, value + 0.0, unit, decisive.time, message, judged=judged)

    def _unknown(self) -> str:
        named = [str(signal) for signal in self.reader.signals if signal.source != "robot"]
        several = (
            f"{', '.join(named)} were never all known at a step" if len(named) > 1 else f"{named[0]} was never known"
        )
        return f"{several}: a sensor gave no reading, or an object had not appeared; run for longer"


def _about_evidence(formula: Formula, first: float, last: float, judged: Judged) -> str:
    """Return the message of a formula that no comparison decides, after steps from `first` to `last` in s."""
    ended = f"the run ended at {last:.4g} s"
    ahead = f"the formula looks {stl.finite_horizon(formula):g} s ahead"
    if judged.moments:
        return f"the interval of the last steps never began: {ended}, and {ahead}; give the outer interval an end"
    for interval, at in _starts(formula, first):
        if at > last:
            missed = f"{ended}, before the interval {interval} began at {at:.3g} s"
            return f"never checked: {missed}; run for longer, or move the interval"
    return f"never checked: {ended}, and {ahead}; run for longer, or shorten its intervals"


def _starts(formula: Formula, at: float) -> Iterator[tuple[Interval, float]]:
    """Yield the intervals of a formula that is judged at a sim time in s, each with its earliest start."""
    if isinstance(formula, stl.Always | stl.Eventually | stl.Until):
        at += formula.interval.start
        yield formula.interval, at
    for part in parts(formula):
        yield from _starts(part, at)


def open_formula(formula: Formula, *, contrary: bool = False) -> Part:
    """Return the fold of a formula, or of its negation, before the first step."""
    match formula:
        case stl.Not():
            return open_formula(formula.formula, contrary=not contrary)
        case stl.And() | stl.Or() | stl.Implies():
            parts = tuple(open_formula(part, contrary=flip) for part, flip in signed_parts(formula, contrary))
            return BooleanPart(parts, every=isinstance(formula, stl.And) != contrary)
        case stl.Always() | stl.Eventually():
            inner = stl.Not(formula.formula) if contrary else formula.formula
            return Extreme.of(inner, formula.interval, greatest=isinstance(formula, stl.Eventually) != contrary)
        case stl.Until() if math.isfinite(lookahead(formula.before, formula.then)):
            return UntilFold.of(formula, contrary=contrary)
        case _:
            return Extreme.at_once(stl.Not(formula) if contrary else formula)


@dataclass(frozen=True)
class BooleanPart(Junction, Part):
    """All of several parts (`every`), or any of them."""

    parts: tuple[Part, ...]
    every: bool

    folds: ClassVar[Sequence[Fold]] = delegated("parts")

    @override
    def observe(self, samples: Samples) -> Self:
        return replace(self, parts=tuple(part.observe(samples) for part in self.parts))

    def outcome(self) -> Outcome:
        """See Part.outcome. A part without a judged step is neither true nor false, and decides if no other part can.

        A false part decides that not all are true (`every`), and a true part decides that any is.
        """
        outcomes = [part.outcome() for part in self.parts]
        judged = [outcome for outcome in outcomes if outcome.judged.moments]
        decisive = (min if self.every else max)(judged or outcomes, key=lambda outcome: outcome.value)
        if len(judged) == len(outcomes) or (judged and (decisive.value >= 0) is not self.every):
            return decisive
        return next(outcome for outcome in outcomes if not outcome.judged.moments)


def _decision(decisive: Cause, unit: str) -> tuple[float, float, str]:
    """Return measured value, limit and message; for two signals, the measured value is their difference."""
    comparison = decisive.comparison
    left, right = units.display_apart(decisive.left, decisive.right, unit)
    when = f"at {decisive.time:.2f} s"
    if any(signals(comparison.right)):
        message = f"{comparison} decides: {left} and {right} {when}"
        return decisive.left - decisive.right, 0.0, message
    message = f"{comparison.left} {comparison.relation} {right} decides: {left} {when}"
    return decisive.left, decisive.right, message


def signed_comparisons(formula: Formula, *, contrary: bool = False) -> Iterator[tuple[stl.Comparison, bool]]:
    """Yield all comparisons of a formula from the left, with True for those whose negation makes it true."""
    if isinstance(formula, stl.Comparison):
        yield formula, contrary
    for part, flip in signed_parts(formula, contrary):
        yield from signed_comparisons(part, contrary=flip)


def compared(formula: Formula, samples: Samples, units: Mapping[stl.Comparison, str]) -> Iterator[Curve]:
    """Yield one curve for each comparison: its measured value with its limit."""
    for comparison, contrary in dict.fromkeys(signed_comparisons(formula)):
        left, right = (values(term, samples) for term in (comparison.left, comparison.right))
        name = str(comparison.left)
        limit = float(right[0])
        if any(signals(comparison.right)):
            name, left, limit = f"{comparison.left} - {_inside(comparison)}", left - right, 0.0
        is_upper = comparison.relation in ("<", "<=")
        lower, upper = (None, limit) if is_upper != contrary else (limit, None)
        yield Curve(name, units[comparison], samples.time, left, lower, upper)


def _inside(comparison: stl.Comparison) -> str:
    return f"({comparison.right})" if isinstance(comparison.right, stl.Sum) else str(comparison.right)


def robustness_so_far(part: Part, samples: Samples, unit: str) -> Curve:
    """Return the robustness of a formula as if the run ended at each step; NaN where it is undefined."""
    count = min(len(samples), _MAX_POINTS)
    ends = np.unique(np.linspace(1, len(samples), count).round().astype(np.intp))
    margins = []
    begin = 0
    for end in ends.tolist():
        part = part.observe(samples.between(begin, end))
        margins.append(part.outcome().value)
        begin = end
    margin = np.array(margins)
    finite = np.where(np.isfinite(margin), margin, np.nan)
    return Curve("robustness", unit, samples.time[ends - 1], finite, lower=0.0).at_end()
