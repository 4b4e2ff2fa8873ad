"""The monitor of a formula. Its outermost operators become goals and invariants; inner operators look ahead."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final, Self

import numpy as np
from typing_extensions import override

from sim_action.assertions.monitors import Fold, Monitor, State
from sim_action.assertions.monitors.combination import Junction
from sim_action.assertions.temporal_logic.formula import (
    Always,
    And,
    Comparison,
    Eventually,
    Formula,
    Implies,
    Interval,
    Not,
    Or,
    Sum,
    Until,
    finite_horizon,
    parts,
    signals,
    signals_of,
    signed_parts,
)
from sim_action.assertions.temporal_logic.operators import Extreme, Outcome, Part, UntilFold, lookahead
from sim_action.assertions.temporal_logic.robustness import Cause, Samples, values
from sim_action.assertions.temporal_logic.signal_reader import SignalReader
from sim_action.assertions.temporal_logic.vacuity import premises
from sim_action.core import units
from sim_action.core.records import dataclass, replace
from sim_action.state.verdict import Judged, Verdict
from sim_action.state.verdict import Signal as Curve

if TYPE_CHECKING:
    from sim_action.state.observation import Observation
    from sim_action.state.trace import Trace
    from sim_action.world.scene import Scene


# A formula that is judged at the end is computed again for each point of the curve.
_MAX_POINTS: Final = 60


@dataclass(frozen=True, slots=True)
class StlMonitor(Monitor):
    """The monitor of a whole formula.

    Attributes:
        reader: the reader of the signals, after the steps so far.
        units: the SI symbol of the margin of each comparison.
        premises: each premise of an implication as text, and the search for a moment at which it holds.
        first, last: the sim times in s of the first and the last step; None before the first one.
    """

    formula: Formula
    part: Part
    reader: SignalReader
    units: Mapping[Comparison, str]
    premises: tuple[tuple[str, Extreme], ...] = ()
    first: float | None = None
    last: float | None = None

    @classmethod
    def of(cls, formula: Formula, comparison_units: Mapping[Comparison, str], scene: Scene, start: Observation) -> Self:
        """Return the monitor before the first step; `start` is the state at t = 0."""
        found = tuple(
            (premise.text, Extreme.of(premise.formula, premise.interval, greatest=True))
            for premise in premises(formula)
        )
        reader = SignalReader.of(signals_of(formula), scene, start)
        return cls(formula, open_formula(formula), reader, comparison_units, found)

    def begin(self, trace: Trace) -> Self:
        """See Monitor.begin. Contact forces are means over the last steps, and readings last."""
        return replace(self, reader=self.reader.begun(trace))

    @property
    @override
    def state(self) -> State:
        return self.part.state

    @property
    @override
    def is_decided(self) -> bool:
        return self.part.is_decided

    @property
    def needed_until(self) -> float:
        """See Monitor.needed_until. The largest end of the finite intervals that are not decided yet."""
        return self.part.needed_until

    @override
    def observe(self, trace: Trace) -> Self:
        if not len(trace):
            return self
        samples, reader = self.reader.read(trace), self.reader.after(trace)
        if not len(samples):
            return replace(self, reader=reader, last=float(trace.time[-1]))
        found = tuple((text, each if each.is_decided else each.observe(samples)) for text, each in self.premises)
        first = float(samples.time[0]) if self.first is None else self.first
        part, last = self.part.observe(samples), float(trace.time[-1])
        return replace(self, part=part, reader=reader, premises=found, first=first, last=last)

    @property
    @override
    def unmet_premises(self) -> tuple[str, ...]:
        return tuple(text for text, premise in self.premises if premise.outcome()[0] < 0)

    def signals(self, trace: Trace) -> tuple[Curve, ...]:
        """See Monitor.signals. Returns the compared quantities and the robustness."""
        samples, found = self.reader.read(trace), set(self.units.values())
        if not len(samples):
            return ()
        robustness = robustness_so_far(self.part, samples, found.pop() if len(found) == 1 else "")
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
        measured, limit, message = _told(decisive, unit)
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
    ahead = f"the formula looks {finite_horizon(formula):g} s ahead"
    if judged.moments:
        return f"the interval of the last steps never began: {ended}, and {ahead}; give the outer interval an end"
    for interval, at in _starts(formula, first):
        if at > last:
            missed = f"{ended}, before the interval {interval} began at {at:.3g} s"
            return f"never checked: {missed}; run for longer, or move the interval"
    return f"never checked: {ended}, and {ahead}; run for longer, or shorten its intervals"


def _starts(formula: Formula, at: float) -> Iterator[tuple[Interval, float]]:
    """Yield the intervals of a formula that is judged at a sim time in s, each with its earliest start."""
    if isinstance(formula, Always | Eventually | Until):
        at += formula.interval.start
        yield formula.interval, at
    for part in parts(formula):
        yield from _starts(part, at)


def open_formula(formula: Formula, *, contrary: bool = False) -> Part:
    """Return the fold of a formula, or of its negation, before the first step."""
    match formula:
        case Not():
            return open_formula(formula.formula, contrary=not contrary)
        case And() | Or() | Implies():
            parts = tuple(open_formula(part, contrary=flip) for part, flip in signed_parts(formula, contrary))
            return BooleanPart(parts, every=isinstance(formula, And) != contrary)
        case Always() | Eventually():
            inner = Not(formula.formula) if contrary else formula.formula
            return Extreme.of(inner, formula.interval, greatest=isinstance(formula, Eventually) != contrary)
        case Until() if math.isfinite(lookahead(formula.before, formula.then)):
            return UntilFold.of(formula, contrary=contrary)
        case _:
            return Extreme.at_once(Not(formula) if contrary else formula)


@dataclass(frozen=True)
class BooleanPart(Junction, Part):
    """All of several parts (`every`), or any of them."""

    parts: tuple[Part, ...]
    every: bool

    @property
    @override
    def folds(self) -> Sequence[Fold]:
        return self.parts

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


def _told(decisive: Cause, unit: str) -> tuple[float, float, str]:
    """Return measured value, limit and message; for two signals, the measured value is their difference."""
    comparison = decisive.comparison
    left, right = units.display_apart(decisive.left, decisive.right, unit)
    when = f"at {decisive.time:.2f} s"
    if any(signals(comparison.right)):
        message = f"{comparison} decides: {left} and {right} {when}"
        return decisive.left - decisive.right, 0.0, message
    message = f"{comparison.left} {comparison.relation} {right} decides: {left} {when}"
    return decisive.left, decisive.right, message


def signed_comparisons(formula: Formula, *, contrary: bool = False) -> Iterator[tuple[Comparison, bool]]:
    """Yield all comparisons of a formula from the left, with True for those whose negation makes it true."""
    if isinstance(formula, Comparison):
        yield formula, contrary
    for part, flip in signed_parts(formula, contrary):
        yield from signed_comparisons(part, contrary=flip)


def compared(formula: Formula, samples: Samples, units: Mapping[Comparison, str]) -> Iterator[Curve]:
    """Yield one curve for each comparison: its measured value with its limit."""
    for comparison, contrary in dict.fromkeys(signed_comparisons(formula)):
        left, right = (values(term, samples) for term in (comparison.left, comparison.right))
        name, limit = str(comparison.left), float(right[0])
        if any(signals(comparison.right)):
            name, left, limit = f"{comparison.left} - {_inside(comparison)}", left - right, 0.0
        is_upper = comparison.relation in ("<", "<=")
        lower, upper = (None, limit) if is_upper != contrary else (limit, None)
        yield Curve(name, units[comparison], samples.time, left, lower, upper)


def _inside(comparison: Comparison) -> str:
    return f"({comparison.right})" if isinstance(comparison.right, Sum) else str(comparison.right)


def robustness_so_far(part: Part, samples: Samples, unit: str) -> Curve:
    """Return the robustness of a formula as if the run ended at each step; NaN where it is undefined."""
    count = min(len(samples), _MAX_POINTS)
    ends = np.unique(np.linspace(1, len(samples), count).round().astype(np.intp))
    margins, begin = [], 0
    for end in ends.tolist():
        part = part.observe(samples.between(begin, end))
        margins.append(part.outcome().value)
        begin = end
    margin = np.array(margins)
    finite = np.where(np.isfinite(margin), margin, np.nan)
    return Curve("robustness", unit, samples.time[ends - 1], finite, lower=0.0).at_end()
