"""Formulas and traces that nobody has written, and what a formula means, word by word."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import strategies as st

from sim_action.assertions.temporal_logic import formula as stl
from sim_action.assertions.temporal_logic.formula import ALL_TIME, Formula, Interval, Term, horizon, signals
from sim_action.assertions.temporal_logic.robustness import Samples

X, Y = stl.Signal("x"), stl.Signal("y")
SIGNALS = (
    X,
    Y,
    stl.Signal("position", "arm/elbow-1"),
    stl.Signal("effort", "it's (one)"),
    stl.Signal("z", source="frame", names=("tool0",)),
    stl.Signal("tilt", source="frame", names=('left/it\'s a "link"',)),
    stl.Signal("ranges", source="sensor", names=("scan 2", "min")),
    stl.Signal("distance", source="pair", names=("tool0", "box, red")),
    stl.Signal("clearance", source="pair"),
    stl.Signal("force", source="pair", names=("box",)),
)
UNITS = ("", "m", "m/s", "rad", "N m", "s")

# Without a sign: that is Negative.
numbers = st.builds(stl.Number, st.floats(0, 1e6).map(lambda value: value + 0.0), st.sampled_from(UNITS))


def _terms(parts: st.SearchStrategy[Term]) -> st.SearchStrategy[Term]:
    several = st.lists(parts, min_size=2, max_size=3).map(tuple)
    return (
        st.builds(stl.Negative, parts)
        | st.builds(stl.Absolute, parts)
        | st.builds(stl.Sum, several)
        | st.builds(stl.Product, several)
    )


terms = st.recursive(numbers | st.sampled_from(SIGNALS), _terms, max_leaves=4)
comparisons = st.builds(stl.Comparison, terms, st.sampled_from(("<", "<=", ">", ">=")), terms).filter(
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
        st.builds(stl.Not, parts)
        | st.builds(stl.And, several)
        | st.builds(stl.Or, several)
        | st.builds(stl.Implies, parts, parts)
        | st.builds(stl.Always, parts, intervals)
        | st.builds(stl.Eventually, parts, intervals)
        | st.builds(stl.Until, parts, parts, intervals)
    )


formulas: st.SearchStrategy[Formula] = st.recursive(comparisons, _formulas, max_leaves=6)

simple = st.builds(
    stl.Comparison,
    st.sampled_from((X, Y)),
    st.sampled_from(("<", ">")),
    st.integers(-2, 2).map(lambda v: stl.Number(float(v))),
)
plain_formulas: st.SearchStrategy[Formula] = st.recursive(simple, _formulas, max_leaves=6)  # without arithmetic

every_step_formulas: st.SearchStrategy[Formula] = st.recursive(
    simple,
    lambda parts: (
        st.builds(stl.And, st.lists(parts, min_size=2, max_size=3).map(tuple))
        | st.builds(stl.Or, st.lists(parts, min_size=2, max_size=3).map(tuple))
        | st.builds(stl.Always, parts, intervals)
        | st.builds(lambda part, interval: stl.Not(stl.Eventually(stl.Not(part), interval)), parts, intervals)
    ),
    max_leaves=6,
).map(stl.Always)
"""Invariants whose inner operators need every step of their interval."""

walks = st.lists(st.tuples(st.integers(-3, 3), st.integers(-3, 3)), min_size=1, max_size=20)
"""x and y at 0 s, 1 s, 2 s, ..."""


def samples_of(walk: list[tuple[int, int]]) -> Samples:
    rows = np.array([(float(time), *map(float, values)) for time, values in enumerate(walk)])
    return Samples((X, Y), rows)


def meaning(  # noqa: PLR0911 - a line for each kind
    formula: Formula, walk: list[tuple[int, int]], at: int, *, contrary: bool = False, strong: bool = False
) -> float:
    """The robustness at a moment, a second apart, as the definition has it: no window is shared, nothing is quick.

    `contrary`: of the negation. `strong`: what needs every moment of a finite interval has seen them all.
    """

    def of(part: Formula, then: int, *, strong: bool) -> float:
        return meaning(part, walk, then, contrary=contrary, strong=strong)

    match formula:
        case stl.Comparison(left, relation, right):
            first, second = (_value(term, walk[at]) for term in (left, right))
            margin = second - first if relation in ("<", "<=") else first - second
            return -margin if contrary else margin
        case stl.Not():
            return meaning(formula.formula, walk, at, contrary=not contrary, strong=strong)
        case stl.And() | stl.Or():
            choose = min if isinstance(formula, stl.And) is not contrary else max
            return choose(of(part, at, strong=strong) for part in formula.formulas)
        case stl.Implies():
            choose = min if contrary else max
            premise = meaning(formula.premise, walk, at, contrary=not contrary, strong=strong)
            return choose(premise, of(formula.conclusion, at, strong=strong))
    later, endless = _later(formula.interval, walk, at), math.isinf(formula.interval.end)
    if isinstance(formula, stl.Until) and not contrary:
        return max(ways(formula, walk, at), default=-math.inf)
    if not isinstance(formula, stl.Until) and isinstance(formula, stl.Eventually) is not contrary:
        return max((of(formula.formula, then, strong=True) for then in later), default=-math.inf)
    inner_strong = strong and not endless
    if isinstance(formula, stl.Until):
        failed = [of(formula.before, k, strong=True) for k in range(at, len(walk))]
        found = [max([of(formula.then, then, strong=inner_strong), *failed[: then - at]]) for then in later]
        beyond = max(failed)
    else:
        found = [of(formula.formula, then, strong=inner_strong) for then in later]
        beyond = -math.inf
    if strong and not endless and at + formula.interval.end > len(walk) - 1:
        found.append(beyond)
    least = min(found, default=math.inf)
    return -math.inf if strong and least == math.inf else least


def ways(formula: stl.Until, walk: list[tuple[int, int]], at: int, *, contrary: bool = False) -> list[float]:
    """How true an `until` is by each moment of its interval; of its negation: how false."""
    befores = [meaning(formula.before, walk, k, contrary=contrary, strong=True) for k in range(at, len(walk))]
    thens = {
        then: meaning(formula.then, walk, then, contrary=contrary, strong=not contrary)
        for then in _later(formula.interval, walk, at)
    }
    choose = max if contrary else min
    return [choose([value, *befores[: then - at]]) for then, value in thens.items()]


def evidence(formula: Formula, walk: list[tuple[int, int]], *, contrary: bool = False) -> tuple[float, int]:
    """The robustness of a whole run, and the number of moments at which it was judged.

    Without one, a part is neither true nor false: the whole is known only if another part is enough.
    """
    match formula:
        case stl.Not():
            return evidence(formula.formula, walk, contrary=not contrary)
        case stl.And() | stl.Or() | stl.Implies():
            several = (
                formula.formulas
                if not isinstance(formula, stl.Implies)
                else (stl.Not(formula.premise), formula.conclusion)
            )
            found = [evidence(part, walk, contrary=contrary) for part in several]
            every = isinstance(formula, stl.And) is not contrary
            known = [one for one in found if one[1]]
            if known:
                best = (min if every else max)(known, key=lambda one: one[0])
                if len(known) == len(found) or (best[0] < 0 if every else best[0] >= 0):
                    return best
            return next(one for one in found if not one[1])
        case stl.Always() | stl.Eventually():
            strong = isinstance(formula, stl.Eventually) is not contrary
            margins = [
                meaning(formula.formula, walk, then, contrary=contrary, strong=strong)
                for then in _later(formula.interval, walk, 0)
            ]
        case stl.Until() if math.isfinite(max(horizon(formula.before), horizon(formula.then))):
            margins = ways(formula, walk, 0, contrary=contrary)
            befores = [meaning(formula.before, walk, k, contrary=contrary, strong=True) for k in range(len(walk))]
            lost = max(befores) if contrary else min(befores)
            if not any(map(math.isfinite, margins)) and (lost >= 0 if contrary else lost < 0):
                return lost, 1
        case _:
            margins = [meaning(formula, walk, 0, contrary=contrary)]
    return meaning(formula, walk, 0, contrary=contrary), sum(map(math.isfinite, margins))


def _later(interval: Interval, walk: list[tuple[int, int]], at: int) -> list[int]:
    return [then for then in range(at, len(walk)) if interval.start <= then - at <= interval.end]


def _value(term: Term, moment: tuple[int, int]) -> float:
    if isinstance(term, stl.Number):
        return term.value
    return float(moment[0] if term == X else moment[1])
