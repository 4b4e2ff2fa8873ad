"""The least and the greatest value of many windows at once, and the values of an unbounded `until`."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

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
