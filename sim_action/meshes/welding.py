"""Weld the points of a mesh: find equal rows among millions of coordinates, in linear time and bounded memory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from sim_action.core.lazy_numpy import NDArray

if TYPE_CHECKING:
    Coordinates = NDArray[np.floating[Any]]

_CHUNK: Final = 1 << 15  # points at a time: the temporary arrays stay in the processor's cache

# Rounds of the hash table, each with another hash. Few points are left after two, except in a file made to collide.
_MAX_ROUNDS: Final = 6

# Odd numbers, to mix the bits of three coordinates.
_FACTORS: Final = (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB)


def welded(points_xyz: Coordinates) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the distinct points (P, 3), the first of equal ones, by z, y and x, and the index of each row."""
    # One row for each axis: a selection of whole points takes ten times as long.
    columns = np.ascontiguousarray(points_xyz.T)
    first = _first_equal(columns)
    kept = np.flatnonzero(first == np.arange(len(first), dtype=first.dtype))
    order = _order(columns.take(kept, axis=1))
    rank = np.empty(len(first), np.int64)
    rank[kept[order]] = np.arange(len(order))
    return np.ascontiguousarray(columns.take(kept[order], axis=1).T, np.float64), rank[first]


def _first_equal(columns: Coordinates) -> NDArray[np.int32]:
    """Return for each point (3, N) the first point that equals it."""
    rows = np.arange(columns.shape[1], dtype=np.int32)
    first = rows.copy()
    # Triangles that share a point are mostly near each other in the file: small tables find most of these.
    for start in range(0, len(rows), _CHUNK):
        _hashed(columns, rows[start : start + _CHUNK], first, 0)
    waiting = rows[first == rows]
    for turn in range(_MAX_ROUNDS):
        if not len(waiting):
            break
        waiting = _hashed(columns, waiting, first, turn)
    if len(waiting):
        _sort(columns, waiting, first)
    return first[first]


def _hashed(columns: Coordinates, waiting: NDArray[np.int32], first: NDArray[np.int32], turn: int) -> NDArray[np.int32]:
    """Find the first equal ones of the waiting points by a hash table. Return those whose slot another has taken."""
    bits = max(8, len(waiting).bit_length())
    slots = np.empty(len(waiting), np.int32)
    chunks = [slice(start, start + _CHUNK) for start in range(0, len(waiting), _CHUNK)]
    for chunk in chunks:
        slots[chunk] = _hash(columns.take(waiting[chunk], axis=1), bits, turn)
    table = np.empty(1 << bits, np.int32)
    # Of several values for one slot the last one stays: from the end, this is the first point.
    for chunk in reversed(chunks):
        table[slots[chunk][::-1]] = waiting[chunk][::-1]
    left = []
    for chunk in chunks:
        rows, found = waiting[chunk], table[slots[chunk]]
        is_same = np.ones(len(rows), np.bool_)
        for column in columns:
            is_same &= column[found] == column[rows]
        first[rows[is_same]] = found[is_same]
        left.append(rows[~is_same])
    return np.concatenate(left)


def _hash(columns: Coordinates, bits: int, turn: int) -> NDArray[np.uint64]:
    """Return a number below 2^bits for each point (3, N); it is the same for zeros of either sign."""
    kind = np.uint32 if columns.itemsize == 4 else np.uint64
    words: NDArray[np.uint32 | np.uint64] = (columns + columns.dtype.type(0)).view(kind)
    mixed = np.zeros(columns.shape[1], np.uint64)
    for column, factor in zip(words, _FACTORS, strict=True):
        mixed ^= column * np.uint64(factor + 2 * turn)
    mixed ^= mixed >> np.uint64(29)
    mixed *= np.uint64(_FACTORS[turn % 3])
    return mixed >> np.uint64(64 - bits)


def _sort(columns: Coordinates, waiting: NDArray[np.int32], first: NDArray[np.int32]) -> None:
    """Find the first equal ones of the waiting points by sorting them."""
    found = columns[:, waiting]
    order = np.lexsort(found)
    is_new = np.concatenate(([True], (found[:, order[1:]] != found[:, order[:-1]]).any(axis=0)))
    first[waiting[order]] = waiting[order[is_new]][np.cumsum(is_new) - 1]


def _order(distinct: Coordinates) -> NDArray[np.intp]:
    """Return the order of distinct points (3, P) by z, then y, then x."""
    if distinct.itemsize != 4:
        return np.lexsort(distinct)
    # Sorting one whole number for z and y is several times as fast as sorting by each of three columns.
    x, y, z = distinct
    key = (_ordinal(z) << 32) + _ordinal(y)
    order = np.argsort(key)
    found = key[order]
    is_tie = np.concatenate(([False], found[1:] == found[:-1], [False]))
    ties = np.flatnonzero(is_tie[1:] | is_tie[:-1])
    tied = order[ties]
    order[ties] = tied[np.lexsort((x[tied], found[ties]))]
    return order


def _ordinal(numbers: Coordinates) -> NDArray[np.int64]:
    words = (numbers + numbers.dtype.type(0)).view(np.int32)
    return np.where(words < 0, words ^ 0x7FFFFFFF, words).astype(np.int64)
