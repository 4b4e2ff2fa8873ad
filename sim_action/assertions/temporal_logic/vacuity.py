"""Parts of a formula that check nothing: comparisons that are always true or false, and premises that never hold."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from itertools import product
from typing import Final

from sim_action.assertions.temporal_logic.formula import (
    Absolute,
    Always,
    Comparison,
    Eventually,
    Formula,
    Implies,
    Interval,
    Negative,
    Number,
    Product,
    Signal,
    Sum,
    Term,
    Until,
    comparisons,
    signals,
    signed_parts,
)
from sim_action.core import units
from sim_action.core.records import dataclass

_ANGLE: Final = re.compile(r"([0-9][0-9.e+-]*) (rad/s|rad)\b")

Range = tuple[float, float]
"""The least and the greatest possible value of a term."""

ANYTHING: Final[Range] = (-math.inf, math.inf)


@dataclass(frozen=True, slots=True)
class Constant:
    """A comparison that has the same result in every run, and its index in the text."""

    comparison: Comparison
    is_true: bool

    @property
    def at(self) -> int:
        """The index in the text at which the comparison begins."""
        return self.comparison.at


def by_name(ranges: Mapping[str, Range]) -> Callable[[Signal], Range]:
    """Return the possible values of a signal; `ranges`: name of a signal of the base -> possible values."""

    def possible(signal: Signal) -> Range:
        if signal.joint:
            return ANYTHING
        low, high = ranges.get(signal.name, ANYTHING)
        # Only the base has the limits of a run.
        return low, math.inf if signal.source == "frame" and signal.name in ("speed", "turn_rate") else high

    return possible


def constant_comparisons(formula: Formula, possible: Callable[[Signal], Range]) -> Iterator[Constant]:
    """Yield the comparisons that are always true or always false; `possible` returns the values of a signal."""
    for comparison in comparisons(formula):
        smaller, greater = comparison.left, comparison.right
        if comparison.relation in (">", ">="):
            smaller, greater = greater, smaller
        (low, high), (other_low, other_high) = _range(smaller, possible), _range(greater, possible)
        if high <= other_low:
            yield Constant(comparison, True)
        elif low > other_high:
            yield Constant(comparison, False)


def _range(term: Term, possible: Callable[[Signal], Range]) -> Range:
    match term:
        case Number():
            return term.value, term.value
        case Signal():
            return possible(term)
        case Negative():
            low, high = _range(term.term, possible)
            return -high, -low
        case Absolute():
            low, high = _range(term.term, possible)
            return max(0.0, low, -high), max(-low, high)
        case Sum():
            each = [_range(part, possible) for part in term.terms]
            return sum(low for low, _ in each), sum(high for _, high in each)
        case Product():
            low, high = 1.0, 1.0
            for factor in term.factors:
                ends = [_times(a, b) for a, b in product((low, high), _range(factor, possible))]
                low, high = min(ends), max(ends)
            return low, high


def _times(first: float, second: float) -> float:
    return first * second if first and second else 0.0


@dataclass(frozen=True, slots=True)
class Beside:
    """A number without a unit that is compared with signals."""

    number: float
    signals: tuple[Signal, ...]
    at: int


def bare_numbers(formula: Formula) -> Iterator[Beside]:
    """Yield each number without a unit that is one side of a comparison, with the signals of the other side."""
    for comparison in comparisons(formula):
        for side, other in ((comparison.left, comparison.right), (comparison.right, comparison.left)):
            number = side.term if isinstance(side, Negative) else side
            if isinstance(number, Number) and not number.unit:
                yield Beside(number.value, tuple(signals(other)), side.at)


@dataclass(frozen=True, slots=True)
class Premise:
    """The premise of an implication, and the times in s after the first step at which it is judged."""

    formula: Formula
    interval: Interval

    @property
    def text(self) -> str:
        """The formula with angles in degrees."""
        return _ANGLE.sub(lambda match: units.display(float(match[1]), match[2]), str(self.formula))


def premises(formula: Formula) -> tuple[Premise, ...]:
    """Return the premises that make a formula true if they never hold."""
    return tuple(_premises(formula, Interval(0.0, 0.0), contrary=False))


def _premises(formula: Formula, when: Interval, *, contrary: bool) -> Iterator[Premise]:
    if isinstance(formula, Implies) and not contrary:
        yield Premise(formula.premise, when)
    for index, (part, flip) in enumerate(signed_parts(formula, contrary)):
        yield from _premises(part, _judged(formula, index, when), contrary=flip)


def _judged(formula: Formula, index: int, when: Interval) -> Interval:
    """Return the times at which a direct subformula is judged; `when`: those of the formula."""
    match formula:
        case Until() if index == 0:
            return _later(when, Interval(0.0, formula.interval.end))
        case Always() | Eventually() | Until():
            return _later(when, formula.interval)
        case _:
            return when


def _later(when: Interval, interval: Interval) -> Interval:
    return Interval(when.start + interval.start, when.end + interval.end)
