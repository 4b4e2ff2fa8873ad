"""The monitor of a formula. Its outermost operators become goals and invariants; inner operators look ahead."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, Final, NamedTuple, Self

import numpy as np

from sim_action.assertions.monitors import State
from sim_action.assertions.monitors.base_motion import BaseMotion
from sim_action.assertions.monitors.goals import joined, joined_by_any
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
    Signal,
    Sum,
    Until,
    parts,
    signals,
    signals_of,
)
from sim_action.assertions.temporal_logic.operators import Extreme, Part, UntilFold, lookahead
from sim_action.assertions.temporal_logic.robustness import Cause, values
from sim_action.assertions.temporal_logic.samples import Samples
from sim_action.core import units
from sim_action.state.verdict import Signal as Curve
from sim_action.state.verdict import Verdict

if TYPE_CHECKING:
    from sim_action.state.trace import Trace


_AT_ONCE: Final = Interval(0.0, 0.0)

# A formula that is judged at the end is computed again for each point of the curve.
_MAX_POINTS: Final = 60


@dataclass(frozen=True, slots=True)
class StlMonitor:
    """The monitor of a whole formula.

    Attributes:
        units: the SI symbol of the margin of each comparison.
        motion: the motion of the base so far.
    """

    is_momentary: ClassVar[bool] = False

    formula: Formula
    part: Part
    sampled: tuple[Signal, ...]
    start_xy: tuple[float, float]
    units: Mapping[Comparison, str]
    motion: BaseMotion
    seen: bool = False

    @classmethod
    def of(
        cls,
        formula: Formula,
        start_xy: tuple[float, float],
        comparison_units: Mapping[Comparison, str],
        motion: BaseMotion,
    ) -> Self:
        """Return the monitor before the first step; `start_xy` in m is the origin of `travel`."""
        return cls(formula, open_formula(formula), signals_of(formula), start_xy, comparison_units, motion)

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return self.part.state

    @property
    def is_decided(self) -> bool:
        """See DecidingMonitor.is_decided."""
        return self.part.is_decided

    @property
    def needed_until(self) -> float:
        """See BoundedMonitor.needed_until. The largest end of the finite intervals that are not decided yet."""
        return self.part.needed_until

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        if not len(trace):
            return self
        part = self.part.observe(self._samples(trace))
        return replace(self, part=part, motion=self.motion.after(trace), seen=True)

    def _samples(self, trace: Trace) -> Samples:
        return Samples.of(trace, self.sampled, self.start_xy, self.motion)

    def signals(self, trace: Trace) -> tuple[Curve, ...]:
        """See PlottableMonitor.signals. Returns the compared quantities and the robustness."""
        samples, found = self._samples(trace), set(self.units.values())
        robustness = robustness_so_far(self.part, samples, found.pop() if len(found) == 1 else "")
        return (*compared(self.formula, samples, self.units), robustness)

    def verdict(self) -> Verdict:
        """Return the verdict: both sides of the deciding comparison, and the robustness as the margin."""
        value, decisive = self.part.outcome() if self.seen else (-math.inf, None)
        passed = value >= 0
        if decisive is None:
            message = "the run ended before the deciding interval" if self.seen else "no physics step to measure"
            return Verdict(passed, None, None, None, "", None, message)
        unit = self.units[decisive.comparison]
        measured, limit, message = _told(decisive, unit)
        return Verdict(passed, measured, limit, value + 0.0, unit, decisive.time, message)


def open_formula(formula: Formula, *, contrary: bool = False) -> Part:
    """Return the fold of a formula, or of its negation, before the first step."""
    match formula:
        case Not():
            return open_formula(formula.formula, contrary=not contrary)
        case And() | Or():
            parts = tuple(open_formula(part, contrary=contrary) for part in formula.formulas)
            return BooleanPart(parts, every=isinstance(formula, And) != contrary)
        case Implies():
            parts = (
                open_formula(formula.premise, contrary=not contrary),
                open_formula(formula.conclusion, contrary=contrary),
            )
            return BooleanPart(parts, every=contrary)
        case Always() | Eventually():
            inner = Not(formula.formula) if contrary else formula.formula
            return Extreme.of(inner, formula.interval, greatest=isinstance(formula, Eventually) != contrary)
        case Until() if math.isfinite(lookahead(formula.before, formula.then)):
            part = UntilFold.of(formula, strict=contrary)
            return NegatedPart(part) if contrary else part
        case _:
            return Extreme.of(Not(formula) if contrary else formula, _AT_ONCE, greatest=True)


@dataclass(frozen=True)
class BooleanPart:
    """All of several parts (`every`), or any of them. The state is cached."""

    parts: tuple[Part, ...]
    every: bool

    @cached_property
    def state(self) -> State:
        """See Monitor.state."""
        if self.every:
            return joined(*(part.state for part in self.parts))
        return joined_by_any((part.state, part.is_decided) for part in self.parts)

    @cached_property
    def is_decided(self) -> bool:
        """See DecidingMonitor.is_decided."""
        alone = State.BROKEN if self.every else State.HOLDS
        known = [part.state for part in self.parts if part.is_decided]
        return alone in known or len(known) == len(self.parts)

    @cached_property
    def needed_until(self) -> float:
        """See BoundedMonitor.needed_until."""
        return 0.0 if self.is_decided else max(part.needed_until for part in self.parts)

    def observe(self, samples: Samples) -> BooleanPart:
        """See Part.observe."""
        return replace(self, parts=tuple(part.observe(samples) for part in self.parts))

    def outcome(self) -> tuple[float, Cause | None]:
        """See Part.outcome."""
        outcomes = [part.outcome() for part in self.parts]
        return (min if self.every else max)(outcomes, key=lambda outcome: outcome[0])


@dataclass(frozen=True, slots=True)
class NegatedPart:
    """The negation of a goal: an invariant that breaks when the goal comes true."""

    part: Part

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return State.BROKEN if self.part.state is State.HOLDS else State.HOLDS

    @property
    def is_decided(self) -> bool:
        """See DecidingMonitor.is_decided."""
        return self.part.is_decided

    @property
    def needed_until(self) -> float:
        """See BoundedMonitor.needed_until."""
        return self.part.needed_until

    def observe(self, samples: Samples) -> NegatedPart:
        """See Part.observe."""
        return NegatedPart(self.part.observe(samples))

    def outcome(self) -> tuple[float, Cause | None]:
        """See Part.outcome."""
        value, decisive = self.part.outcome()
        return -value, None if decisive is None else replace(decisive, margin=-decisive.margin)


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


class Asked(NamedTuple):
    """A comparison, and True if its negation makes the formula true."""

    comparison: Comparison
    contrary: bool


def asked(formula: Formula, *, contrary: bool = False) -> Iterator[Asked]:
    """Yield all comparisons of a formula, from the left."""
    match formula:
        case Comparison():
            yield Asked(formula, contrary)
        case Not():
            yield from asked(formula.formula, contrary=not contrary)
        case Implies():
            yield from asked(formula.premise, contrary=not contrary)
            yield from asked(formula.conclusion, contrary=contrary)
        case _:
            for part in parts(formula):
                yield from asked(part, contrary=contrary)


def compared(formula: Formula, samples: Samples, units: Mapping[Comparison, str]) -> Iterator[Curve]:
    """Yield one curve for each comparison: its measured value with its limit."""
    for comparison, contrary in dict.fromkeys(asked(formula)):
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
        margins.append(part.outcome()[0])
        begin = end
    margin = np.array(margins)
    finite = np.where(np.isfinite(margin), margin, np.nan)
    return Curve("robustness", unit, samples.time[ends - 1], finite, lower=0.0).at_end()
