"""The one place that decides whether a formula can fail, and whether it can hold: interval and linear arithmetic.

A formula is split into cases, each a set of linear inequalities that must hold together, now or at one later moment. A
case without a solution within the possible values of the signals never comes about (Fourier-Motzkin elimination).
Products of signals and deep formulas are approximated: they may be called possible although they are not.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from itertools import product
from typing import Final

from sim_action.assertions.temporal_logic import formula as stl
from sim_action.assertions.temporal_logic.formula import Formula, Interval, Term, signed_parts
from sim_action.core.records import dataclass, field

Range = tuple[float, float]  # the least and the greatest possible value of a term
ANYTHING: Final[Range] = (-math.inf, math.inf)
Possible = Callable[[stl.Signal], Range]  # returns the possible values of a signal
_MAX_CASES: Final = 64
_MAX_ROWS: Final = 400


@dataclass(frozen=True, slots=True)
class Constant:
    """A part of a formula that has the same result in every run."""

    part: Formula
    is_true: bool

    @property
    def at(self) -> int:
        """The index in the text at which its first comparison begins."""
        return next(comparison.at for comparison in stl.comparisons(self.part))


def by_name(ranges: Mapping[str, Range]) -> Possible:
    """Return the possible values of a signal; `ranges`: name of a signal of the base -> possible values."""

    def possible(signal: stl.Signal) -> Range:
        if signal.joint:
            return ANYTHING
        low, high = ranges.get(signal.name, ANYTHING)
        # Only the base has the limits of a run.
        return low, math.inf if signal.source == "frame" and signal.name in ("speed", "turn_rate") else high

    return possible


def constants(formula: Formula, possible: Possible) -> Iterator[Constant]:
    """Yield the innermost parts that are always true or always false."""
    reported = list[Constant]()
    for part in reversed(list(stl.everything(formula))):
        if any(constant.part in stl.everything(part) for constant in reported):
            continue
        if not can_be(part, possible, true=False):
            reported.append(Constant(part, True))
        elif not can_be(part, possible, true=True):
            reported.append(Constant(part, False))
    yield from reversed(reported)


def can_be(formula: Formula, possible: Possible, *, true: bool) -> bool:
    """Return False only if no possible values of signals make a formula true, or false; a margin of 0 is true."""
    try:
        return any(_is_possible(case, possible, strict=not true) for case in _cases(formula, true))
    except _Unclear:
        return True


class _Unclear(Exception):
    """A formula with too many cases."""


Row = dict[Term | None, float]  # a sum of terms, each with its factor, that is at least 0; None stands for 1


@dataclass(frozen=True, slots=True)
class _Later:
    """Cases at all moments of an interval (`always`), or at one of them."""

    always: bool
    interval: Interval
    cases: list[_Case]


@dataclass(frozen=True, slots=True)
class _Case:
    """Inequalities that hold now, and what holds later."""

    rows: tuple[Row, ...] = ()
    later: tuple[_Later, ...] = field(default=())

    def also(self, other: _Case) -> _Case:
        return _Case(self.rows + other.rows, self.later + other.later)


def _cases(formula: Formula, is_true: bool) -> list[_Case]:
    """Return the cases in which a formula is true, or those in which it is false unless `is_true`."""
    match formula:
        case stl.Comparison():
            smaller, greater = formula.left, formula.right
            if (formula.relation in (">", ">=")) == is_true:
                smaller, greater = greater, smaller
            return _signs(_added(_linear(greater), _linear(smaller), -1.0))
        case stl.Always() | stl.Eventually():
            inner = _cases(formula.formula, is_true)
            return [_Case(later=(_Later(isinstance(formula, stl.Always) == is_true, formula.interval, inner),))]
        case stl.Until():
            inner = _cases(formula.then, True)
            return [_Case(later=(_Later(False, formula.interval, inner),) if is_true else ())]
        case _:
            parts = [_cases(part, not flip) for part, flip in signed_parts(formula, not is_true)]
            return (
                _all_of(parts) if isinstance(formula, stl.And) == is_true else [case for part in parts for case in part]
            )


def _all_of(parts: list[list[_Case]]) -> list[_Case]:
    cases = [_Case()]
    for part in parts:
        cases = [one.also(other) for one, other in product(cases, part)]
        if len(cases) > _MAX_CASES:
            raise _Unclear
    return cases


def _is_possible(case: _Case, possible: Possible, *, strict: bool) -> bool:
    """Return False if the inequalities of a case, now or at a later moment, contradict each other."""
    throughout = [part for part in case.later if part.always]
    now = _all_of([[_Case(case.rows)], *(part.cases for part in throughout if part.interval.start == 0)])
    if not any(_has_solution(one.rows, possible, strict=strict) for one in now):
        return False
    for once in case.later:
        if not once.always:
            start, end = once.interval.start, once.interval.end
            around = [part.cases for part in throughout if part.interval.start <= start and end <= part.interval.end]
            if not any(_is_possible(one, possible, strict=strict) for one in _all_of([once.cases, *around])):
                return False
    return True


def _linear(term: Term) -> Row:
    match term:
        case stl.Number():
            return {None: term.value}
        case stl.Negative():
            return _added({}, _linear(term.term), -1.0)
        case stl.Sum():
            total: Row = {}
            for part in term.terms:
                total = _added(total, _linear(part), 1.0)
            return total
        case stl.Product():
            factor = 1.0
            others = list[Row]()
            for row in map(_linear, term.factors):
                if row.keys() <= {None}:
                    factor *= row.get(None, 0.0)
                else:
                    others.append(row)
            if len(others) > 1:
                return {term: 1.0}
            return _added({}, others[0] if others else {None: 1.0}, factor)
        case _:
            return {term: 1.0}


def _added(row: Row, other: Row, factor: float) -> Row:
    return {name: row.get(name, 0.0) + factor * other.get(name, 0.0) for name in {**row, **other}}


def _signs(row: Row) -> list[_Case]:
    """Return the cases of an inequality: a value less an absolute value is less for both signs, plus one for either."""
    inner = next((term for term, factor in row.items() if isinstance(term, stl.Absolute) and factor), None)
    if inner is None:
        return [_Case((row,))]
    assert isinstance(inner, stl.Absolute)
    rest, factor = {term: value for term, value in row.items() if term != inner}, row[inner]
    both = [_signs(_added(rest, _linear(inner.term), sign * factor)) for sign in (1.0, -1.0)]
    return _all_of(both) if factor < 0 else [case for cases in both for case in cases]


def _has_solution(rows: tuple[Row, ...], possible: Possible, *, strict: bool) -> bool:
    """Return False if no values satisfy the inequalities; `strict`: they are more than 0, not at least 0."""
    names = dict.fromkeys(name for row in rows for name in row if name is not None)
    left = [(row, strict) for row in rows]
    for name in names:
        low, high = _range(name, possible)
        left += [({name: 1.0, None: -low}, False)] if math.isfinite(low) else []
        left += [({name: -1.0, None: high}, False)] if math.isfinite(high) else []
    for name in names:
        above = [(row, is_strict) for row, is_strict in left if row.get(name, 0.0) > 0]
        below = [(row, is_strict) for row, is_strict in left if row.get(name, 0.0) < 0]
        left = [(row, is_strict) for row, is_strict in left if not row.get(name, 0.0)]
        for (one, first), (other, second) in product(above, below):
            left.append((_added(_added({}, one, 1 / one[name]), other, -1 / other[name]), first or second))
        if len(left) > _MAX_ROWS:
            raise _Unclear
    return not any(row.get(None, 0.0) < 0 or (is_strict and row.get(None, 0.0) <= 0) for row, is_strict in left)


def _range(term: Term, possible: Possible) -> Range:
    """Return the possible values of a signal or of a product of signals, of which only the sign is known."""
    match term:
        case stl.Signal():
            return possible(term)
        case stl.Absolute():
            return 0.0, math.inf
        case stl.Product():
            odd = (factor for factor, power in Counter(term.factors).items() if power % 2)
            return (0.0 if all(_range(factor, possible)[0] >= 0 for factor in odd) else -math.inf), math.inf
        case _:
            return ANYTHING
