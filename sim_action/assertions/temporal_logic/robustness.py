"""By how much a formula holds at each moment, and what decides that at one of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import reduce
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_action.assertions.temporal_logic.formula import (
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
    horizon,
)
from sim_action.assertions.temporal_logic.samples import Samples
from sim_action.state.trace import FloatArray

Indices = NDArray[np.intp]

NOTHING_LEAST: Final = np.inf
"""The least value of an empty window."""


def least_of_windows(values: FloatArray, first: Indices, last: Indices) -> FloatArray:
    """(N,) the least of `values[first:last]` for N windows; +inf for an empty one. Takes O(n log n) time.

    A window is covered by two of a power of two each, which may overlap: the least of these are made by doubling
    (a sparse table, of which one row at a time is kept).
    """
    found = np.full(len(first), NOTHING_LEAST)
    length = last - first
    # Of a positive whole number, the exponent of the greatest power of two that is not above it.
    level = np.frexp(length.astype(np.float64))[1] - 1
    row, width = values, 1
    for step in range(int(level.max(initial=-1)) + 1):
        here = (level == step) & (length > 0)
        found[here] = np.minimum(row[first[here]], row[last[here] - width])
        row, width = np.minimum(row[:-width], row[width:]), 2 * width
    return found


def greatest_of_windows(values: FloatArray, first: Indices, last: Indices) -> FloatArray:
    """(N,) the greatest of `values[first:last]` for N windows; -inf for an empty one."""
    return -least_of_windows(-values, first, last)


def until(before: FloatArray, then: FloatArray) -> FloatArray:
    """(T,) z with z[i] = max(then[i], min(before[i], z[i + 1])), where nothing follows the last. O(n log n) time.

    What a moment does to the value of the next one is to clip it, from `then` to the greater of both; two such steps
    are one again, so those of 1, 2, 4, ... moments are made by doubling.
    """
    lower, upper = then.copy(), np.maximum(before, then)
    width = 1
    while width < len(lower):
        near_low, near_high = lower[:-width], upper[:-width]
        lower[:-width], upper[:-width] = (
            np.clip(lower[width:], near_low, near_high),
            np.clip(upper[width:], near_low, near_high),
        )
        width *= 2
    return lower


def robustness(formula: Formula, samples: Samples) -> FloatArray:  # noqa: PLR0911 - a line for each kind
    """(T,) margins: positive where the formula holds, as far as the samples go."""
    match formula:
        case Comparison(left, relation, right):
            difference = values(left, samples) - values(right, samples)
            return -difference if relation in ("<", "<=") else difference
        case Not():
            return -robustness(formula.formula, samples)
        case And():
            return reduce(np.minimum, (robustness(part, samples) for part in formula.formulas))
        case Or():
            return reduce(np.maximum, (robustness(part, samples) for part in formula.formulas))
        case Implies():
            return np.maximum(-robustness(formula.premise, samples), robustness(formula.conclusion, samples))
        case Always():
            return least_of_windows(robustness(formula.formula, samples), *_windows(formula.interval, samples))
        case Eventually():
            return greatest_of_windows(robustness(formula.formula, samples), *_windows(formula.interval, samples))
        case Until():
            before, then = robustness(formula.before, samples), robustness(formula.then, samples)
            return _until(before, then, formula.interval, samples)


def values(term: Term, samples: Samples) -> FloatArray:
    """(T,) a term at each moment, in SI units."""
    match term:
        case Number():
            return np.full(len(samples), term.value)
        case Signal():
            return samples.of_signal(term)
        case Negative():
            return -values(term.term, samples)
        case Absolute():
            return np.abs(values(term.term, samples))
        case Sum():
            return reduce(np.add, (values(part, samples) for part in term.terms))
        case Product():
            return reduce(np.multiply, (values(factor, samples) for factor in term.factors))


def _windows(interval: Interval, samples: Samples) -> tuple[Indices, Indices]:
    """For each moment, where its interval begins and ends, cut at the last moment."""
    first = samples.at_or_after(samples.time + interval.start)
    return first, np.maximum(first, samples.after(samples.time + interval.end))


def _until(before: FloatArray, then: FloatArray, interval: Interval, samples: Samples) -> FloatArray:
    """The bounded one by three that are cheap: something in the interval, all before it, and no end (Donze 2013).

    `p until[a, b] q` says as much as `eventually[a, b] q`, p at every moment before a, and `p until q` at a.
    """
    endless = until(before, then)
    first, last = _windows(interval, samples)
    here = np.arange(len(samples), dtype=np.intp)
    met = greatest_of_windows(then, first, last)
    held = least_of_windows(before, here, first)
    there = np.append(endless, -np.inf)[first]
    least: FloatArray = np.minimum(np.minimum(met, held), there)
    return least


@dataclass(frozen=True, slots=True)
class Cause:
    """The one comparison, at one moment, whose difference is the robustness of a whole formula.

    Attributes:
        time: s of sim time.
        left, right: its two sides, in SI units.
        margin: their difference, positive if the formula holds.
    """

    comparison: Comparison
    time: float
    left: float
    right: float
    margin: float


def cause(formula: Formula, samples: Samples, index: int = 0) -> Cause | None:
    """What decides about a formula at a moment; None where its window is empty."""
    ahead = samples.between(index, _seen_from(formula, samples, index))
    match formula:
        case Comparison():
            return _compared(formula, ahead)
        case Not():
            found = cause(formula.formula, ahead)
            return None if found is None else replace(found, margin=-found.margin)
        case And() | Or():
            decisive = min if isinstance(formula, And) else max
            return cause(decisive(formula.formulas, key=lambda part: _first(part, ahead)), ahead)
        case Implies():
            return cause(Or((Not(formula.premise), formula.conclusion)), ahead)
        case Always() | Eventually():
            return _cause_in_window(formula, ahead)
        case Until():
            return _cause_of_until(formula, ahead)


def _seen_from(formula: Formula, samples: Samples, index: int) -> int:
    """Where the moments end that a formula depends on at one of them."""
    if math.isinf(reach := horizon(formula)):
        return len(samples)
    return max(index + 1, int(samples.after(float(samples.time[index]) + reach)))


def _first(formula: Formula, samples: Samples) -> float:
    return float(robustness(formula, samples)[0])


def _compared(comparison: Comparison, samples: Samples) -> Cause:
    now = samples.between(0, 1)
    left, right = (float(values(term, now)[0]) for term in (comparison.left, comparison.right))
    return Cause(comparison, float(now.time[0]), left, right, float(robustness(comparison, now)[0]))


def _cause_in_window(formula: Always | Eventually, samples: Samples) -> Cause | None:
    first, last = (int(ends[0]) for ends in _windows(formula.interval, samples))
    if first == last:
        return None
    inside = robustness(formula.formula, samples)[first:last]
    index = int(inside.argmin() if isinstance(formula, Always) else inside.argmax())
    return cause(formula.formula, samples, first + index)


def _cause_of_until(formula: Until, samples: Samples) -> Cause | None:
    first, last = (int(ends[0]) for ends in _windows(formula.interval, samples))
    if first == last:
        return None
    before, then = robustness(formula.before, samples), robustness(formula.then, samples)
    held = np.minimum.accumulate(np.concatenate(([np.inf], before[:-1])))
    index = first + int(np.minimum(then, held)[first:last].argmax())
    if then[index] <= held[index]:
        return cause(formula.then, samples, index)
    return cause(formula.before, samples, int(before[:index].argmin()))
