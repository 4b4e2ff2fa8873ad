"""Weld the points of a mesh: find equal rows among millions of coordinates, in linear time and bounded memory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Coordinates = NDArray[np.floating[Any]]

# Rows at a time: the temporary arrays stay in the processor's cache.
_CHUNK_ROWS: Final = 1 << 16

# Rounds of the hash table, each with another hash. Few rows are left after two; a file made to collide ends the search.
_MAX_ROUNDS: Final = 6

# Odd numbers, to mix the bits of three coordinates.
_FACTORS: Final = (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB)


def welded(points_xyz: Coordinates) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the distinct points (P, 3), sorted by z, y and x, and the index of each row among them.

    Zeros of either sign are equal; the first row of equal ones is kept.

    :param points_xyz: (N, 3) finite coordinates.
    """
    first = _first_equal_rows(points_xyz)
    kept = np.flatnonzero(first == np.arange(len(first), dtype=first.dtype))
    distinct = points_xyz[kept]
    order = _order(distinct)
    rank = np.empty(len(first), np.int64)
    rank[kept[order]] = np.arange(len(order))
    return distinct[order].astype(np.float64), rank[first]


def _first_equal_rows(points: Coordinates) -> NDArray[np.int32]:
    """Return for each row the first row that equals it."""
    first = np.arange(len(points), dtype=np.int32)
    waiting = first.copy()
    for turn in range(_MAX_ROUNDS):
        if not len(waiting):
            return first
        waiting = _hashed(points, waiting, first, turn)
    return _sorted_first(points, waiting, first) if len(waiting) else first


def _hashed(points: Coordinates, waiting: NDArray[np.int32], first: NDArray[np.int32], turn: int) -> NDArray[np.int32]:
    """Find the first equal row by a hash table. Return the rows whose slot another point has taken."""
    bits = max(8, len(waiting).bit_length())
    slots = np.empty(len(waiting), np.int32)
    chunks = [slice(start, start + _CHUNK_ROWS) for start in range(0, len(waiting), _CHUNK_ROWS)]
    for chunk in chunks:
        slots[chunk] = _hash(points[waiting[chunk]], bits, turn)
    table = np.empty(1 << bits, np.int32)
    # Of several values for one slot the last one stays: from the end, this is the first row.
    for chunk in reversed(chunks):
        table[slots[chunk][::-1]] = waiting[chunk][::-1]
    left = []
    for chunk in chunks:
        rows, found = waiting[chunk], table[slots[chunk]]
        equal = points[found] == points[rows]
        is_same = equal[:, 0] & equal[:, 1] & equal[:, 2]
        first[rows[is_same]] = found[is_same]
        left.append(rows[~is_same])
    return np.concatenate(left)


def _hash(points: Coordinates, bits: int, turn: int) -> NDArray[np.int32]:
    """Return a number below 2^bits for each point; it is the same for zeros of either sign."""
    kind = np.uint32 if points.itemsize == 4 else np.uint64
    words: NDArray[np.uint32 | np.uint64] = (points + points.dtype.type(0)).view(kind)
    mixed = np.zeros(len(points), np.uint64)
    for column, factor in enumerate(_FACTORS):
        mixed ^= words[:, column] * np.uint64(factor + 2 * turn)
    mixed ^= mixed >> np.uint64(29)
    mixed *= np.uint64(_FACTORS[turn % 3])
    return (mixed >> np.uint64(64 - bits)).astype(np.int32)


def _sorted_first(points: Coordinates, waiting: NDArray[np.int32], first: NDArray[np.int32]) -> NDArray[np.int32]:
    """Find the first equal row of the waiting rows by sorting them."""
    rows = points[waiting]
    order = np.lexsort(rows.T)
    is_new = np.concatenate(([True], (rows[order[1:]] != rows[order[:-1]]).any(axis=1)))
    first[waiting[order]] = waiting[order[is_new]][np.cumsum(is_new) - 1]
    return first


def _order(distinct: Coordinates) -> NDArray[np.intp]:
    """Return the order of distinct points by z, then y, then x."""
    if distinct.itemsize != 4:
        return np.lexsort(distinct.T)
    # Sorting one whole number for z and y is several times as fast as sorting by each of three columns.
    key = (_ordinal(distinct[:, 2]) << 32) + _ordinal(distinct[:, 1])
    order = np.argsort(key)
    found = key[order]
    is_tie = np.concatenate(([False], found[1:] == found[:-1], [False]))
    ties = np.flatnonzero(is_tie[1:] | is_tie[:-1])
    tied = order[ties]
    order[ties] = tied[np.lexsort((distinct[tied, 0], found[ties]))]
    return order


def _ordinal(numbers: Coordinates) -> NDArray[np.int64]:
    """Return whole numbers of 32 bits in the order of finite floats of 32 bits."""
    words = (numbers + numbers.dtype.type(0)).view(np.int32)
    return np.where(words < 0, words ^ 0x7FFFFFFF, words).astype(np.int64)
