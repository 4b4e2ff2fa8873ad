"""The robustness of a formula at each step, and the comparison that decides it."""

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
"""The minimum of an empty window."""


def least_of_windows(values: FloatArray, first: Indices, last: Indices) -> FloatArray:
    """Return (N,) the minimum of `values[first:last]` for N windows; +inf for an empty one. Runs in O(n log n).

    Two overlapping windows of a power of two cover each window. Their minima come from a sparse table by doubling, of
    which only one row is kept.
    """
    found = np.full(len(first), NOTHING_LEAST)
    length = last - first
    # The base-2 logarithm of the length, rounded down.
    level = np.frexp(length.astype(np.float64))[1] - 1
    row, width = values, 1
    for step in range(int(level.max(initial=-1)) + 1):
        here = (level == step) & (length > 0)
        found[here] = np.minimum(row[first[here]], row[last[here] - width])
        row, width = np.minimum(row[:-width], row[width:]), 2 * width
    return found


def greatest_of_windows(values: FloatArray, first: Indices, last: Indices) -> FloatArray:
    """Return (N,) the maximum of `values[first:last]` for N windows; -inf for an empty one."""
    return -least_of_windows(-values, first, last)


def until(before: FloatArray, then: FloatArray) -> FloatArray:
    """Return (T,) z with z[i] = max(then[i], min(before[i], z[i + 1])), and z[T] = -inf. Runs in O(n log n).

    Each step clips the value of the next one to [then, max(before, then)]. Two such clips are one clip again, so the
    clips of 1, 2, 4, ... steps are made by doubling.
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
    """Return (T,) margins: positive where the formula holds on the given samples."""
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
    """Return (T,) the value of a term at each step, in SI units."""
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
    """Return the begin and end index of the interval of each step, cut at the last step."""
    first = samples.at_or_after(samples.time + interval.start)
    return first, np.maximum(first, samples.after(samples.time + interval.end))


def _until(before: FloatArray, then: FloatArray, interval: Interval, samples: Samples) -> FloatArray:
    """Return the bounded `until` from three cheap parts (Donze 2013).

    `p until[a, b] q` equals `eventually[a, b] q`, and p at every step before a, and `p until q` at a.
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
    """The comparison and the step whose difference equals the robustness of a whole formula.

    Attributes:
        time: sim time in s.
        left, right: both sides in SI units.
        margin: their difference, positive if the formula holds.
    """

    comparison: Comparison
    time: float
    left: float
    right: float
    margin: float


def cause(formula: Formula, samples: Samples, index: int = 0) -> Cause | None:
    """Return the comparison that decides a formula at a step; None if its window is empty."""
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
    """Return the end index of the samples that a formula at a step depends on."""
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
