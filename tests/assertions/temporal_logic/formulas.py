"""Formulas and traces that nobody has written, and what a formula means, word by word."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import strategies as st

from sim_action.assertions.temporal_logic.formula import (
    ALL_TIME,
    Absolute,
    Always,
    And,
    Comparison,
    Eventually,
    Formula,
    Implies,
    Interval,
    Negative,
    Not,
    Number,
    Or,
    Product,
    Signal,
    Sum,
    Term,
    Until,
    signals,
)
from sim_action.assertions.temporal_logic.samples import Samples

X, Y = Signal("x"), Signal("y")
SIGNALS = (X, Y, Signal("position", "arm/elbow-1"))
UNITS = ("", "m", "m/s", "rad", "N m", "s")

numbers = st.builds(
    Number, st.floats(0, 1e6, allow_nan=False).map(lambda value: value + 0.0), st.sampled_from(UNITS)
)  # without a sign: that is Negative


def _terms(parts: st.SearchStrategy[Term]) -> st.SearchStrategy[Term]:
    several = st.lists(parts, min_size=2, max_size=3).map(tuple)
    return (
        st.builds(Negative, parts) | st.builds(Absolute, parts) | st.builds(Sum, several) | st.builds(Product, several)
    )


terms = st.recursive(numbers | st.sampled_from(SIGNALS), _terms, max_leaves=4)
comparisons = st.builds(Comparison, terms, st.sampled_from(("<", "<=", ">", ">=")), terms).filter(
    lambda found: any(True for term in (found.left, found.right) for _ in signals(term))
)
seconds = st.integers(0, 12).map(float)
intervals = (
    st.just(ALL_TIME)
    | st.tuples(seconds, seconds).map(lambda ends: Interval(min(ends), max(ends)))
    | seconds.filter(bool).map(lambda start: Interval(start, math.inf))
)


def _formulas(parts: st.SearchStrategy[Formula]) -> st.SearchStrategy[Formula]:
    several = st.lists(parts, min_size=2, max_size=3).map(tuple)
    return (
        st.builds(Not, parts)
        | st.builds(And, several)
        | st.builds(Or, several)
        | st.builds(Implies, parts, parts)
        | st.builds(Always, parts, intervals)
        | st.builds(Eventually, parts, intervals)
        | st.builds(Until, parts, parts, intervals)
    )


formulas: st.SearchStrategy[Formula] = st.recursive(comparisons, _formulas, max_leaves=6)

simple = st.builds(
    Comparison, st.sampled_from((X, Y)), st.sampled_from(("<", ">")), st.integers(-2, 2).map(lambda v: Number(float(v)))
)
plain_formulas: st.SearchStrategy[Formula] = st.recursive(simple, _formulas, max_leaves=6)
"""Without arithmetic."""

walks = st.lists(st.tuples(st.integers(-3, 3), st.integers(-3, 3)), min_size=1, max_size=20)
"""x and y at 0 s, 1 s, 2 s, ..."""


def samples_of(walk: list[tuple[int, int]]) -> Samples:
    rows = np.array([(float(time), *map(float, values)) for time, values in enumerate(walk)])
    return Samples((X, Y), rows)


def meaning(formula: Formula, walk: list[tuple[int, int]], at: int) -> float:  # noqa: PLR0911 - a line for each kind
    """The robustness at a moment, a second apart, as the definition has it: no window is shared, nothing is quick."""
    match formula:
        case Comparison(left, relation, right):
            first, second = (_value(term, walk[at]) for term in (left, right))
            return second - first if relation in ("<", "<=") else first - second
        case Not():
            return -meaning(formula.formula, walk, at)
        case And():
            return min(meaning(part, walk, at) for part in formula.formulas)
        case Or():
            return max(meaning(part, walk, at) for part in formula.formulas)
        case Implies():
            return max(-meaning(formula.premise, walk, at), meaning(formula.conclusion, walk, at))
        case Always():
            later = _later(formula.interval, walk, at)
            return min((meaning(formula.formula, walk, then) for then in later), default=math.inf)
        case Eventually():
            later = _later(formula.interval, walk, at)
            return max((meaning(formula.formula, walk, then) for then in later), default=-math.inf)
        case Until():
            ways = [
                min([meaning(formula.then, walk, then), *(meaning(formula.before, walk, k) for k in range(at, then))])
                for then in _later(formula.interval, walk, at)
            ]
            return max(ways, default=-math.inf)


def _later(interval: Interval, walk: list[tuple[int, int]], at: int) -> list[int]:
    return [then for then in range(at, len(walk)) if interval.start <= then - at <= interval.end]


def _value(term: Term, moment: tuple[int, int]) -> float:
    if isinstance(term, Number):
        return term.value
    return float(moment[0] if term == X else moment[1])
