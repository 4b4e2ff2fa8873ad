"""The mesh that all formats are read into: points and triangles, with limits of size.

Equal points are welded: rows that are equal among millions of coordinates, in linear time and bounded memory.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Final

from sim_action.core.lazy_numpy import NDArray, np
from sim_action.core.records import dataclass

if TYPE_CHECKING:
    Coordinates = NDArray[np.floating[Any]]


MAX_BYTES: Final = 110_000_000  # Limit per file. Text formats need up to 300 bytes per triangle, binary STL 50.

MAX_TRIANGLES: Final = 500_000
"""Limit per file of text. Links have up to about 100,000 triangles; reading this many takes one or two seconds."""

MAX_BINARY_TRIANGLES: Final = 2_100_000  # Limit per file of binary STL. Reading this many takes one or two seconds.
MAX_POINTS: Final = 3 * MAX_TRIANGLES  # limit per file: three per triangle
MAX_PARTS: Final = 10_000  # limit per file of objects, solids or instances

_MAX_COORDINATE: Final = 1e9
"""Limit of coordinates in the file's units. The largest robot measures 100 m, which is 1e8 micrometres."""

_NO_AREA: Final = 1e-10  # area, relative to the squared longest side, below which a triangle is a line
_CHUNK_TRIANGLES: Final = 1 << 14  # triangles at a time: the temporary arrays stay in the processor's cache


class MeshError(ValueError):
    """An unusable mesh; the message continues a sentence that starts with the file's name."""

    def __init__(self, rule: str, message: str, line: int | None = None) -> None:
        self.rule, self.message, self.line = rule, message, line
        super().__init__(f"line {line}: {message}" if line else message)


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles with an area."""

    points_xyz: NDArray[np.float64]  # (P, 3) distinct points in the file's units; each is a corner of a triangle
    parts: tuple[NDArray[np.int64], ...]  # (T, 3) each, indices of `points_xyz`; the separate objects of the file


def mesh_of(points_xyz: NDArray[np.floating[Any]], parts: Sequence[NDArray[np.int64] | slice]) -> Mesh:
    """Return the mesh of points and triangles, without triangles that have no area. Raises MeshError.

    :param points_xyz: (N, 3) of 32 or 64 bits; equal ones become one.
    :param parts: rows of the points (T, 3); or a slice of triangles, if each triangle has three rows of its own.
    """
    # The least and the greatest number of an array with a NaN are NaN, too.
    least, greatest = (points_xyz.min(), points_xyz.max()) if points_xyz.size else (0, 0)
    if not (least >= -_MAX_COORDINATE and greatest <= _MAX_COORDINATE):
        raise MeshError("broken-mesh", f"has a coordinate that is not finite or is beyond {_MAX_COORDINATE:g}")
    are_kept = [_have_area(points_xyz, part) for part in parts]
    if not any(is_kept.any() for is_kept in are_kept):
        cause = "none of its triangles has an area" if any(map(len, are_kept)) else "there is no triangle in it"
        raise MeshError("empty-mesh", f"{cause}; export it again, as a surface of triangles")
    points, names = welded(points_xyz)
    selected_parts = [
        _selected(_of_triangles(names, part), is_kept) for part, is_kept in zip(parts, are_kept, strict=True)
    ]
    kept = [part for part in selected_parts if len(part)]
    used, triangles = compacted(points, kept[0] if len(kept) == 1 else np.concatenate(kept))
    ends = np.cumsum([len(part) for part in kept])[:-1]
    return Mesh(used, tuple(np.split(triangles, ends)))


def compacted(
    points_xyz: NDArray[np.float64], triangles: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the points that triangles use, and the triangles as indices of these."""
    is_used = np.zeros(len(points_xyz), np.bool_)
    is_used[triangles] = True
    if is_used.all():
        return points_xyz, triangles
    return points_xyz[is_used], (np.cumsum(is_used) - 1)[triangles]


def refuse_more_triangles(count: int, most: int = MAX_TRIANGLES) -> None:
    """Raise MeshError if there are more than are read."""
    if count > most:
        message = f"has {count:,} triangles or more; at most {most:,} are read; simplify it: a few thousand"
        raise MeshError("too-large-mesh", f"{message} are enough for collisions")


def refuse_more_points(count: int) -> None:
    """Raise MeshError if there are more than are read."""
    if count > MAX_POINTS:
        raise MeshError("too-large-mesh", f"has {count:,} points or more; at most {MAX_POINTS:,} are read")


def refuse_more_parts(count: int) -> None:
    """Raise MeshError if there are more than are read."""
    if count > MAX_PARTS:
        raise MeshError("too-large-mesh", f"has {count:,} parts or more; at most {MAX_PARTS:,} are read")


def _of_triangles(rows: NDArray[Any], part: NDArray[np.int64] | slice) -> NDArray[Any]:
    return rows.reshape(-1, 3, *rows.shape[1:])[part] if isinstance(part, slice) else rows[part]


def _selected(triangles: NDArray[np.int64], is_kept: NDArray[np.bool_]) -> NDArray[np.int64]:
    return triangles if is_kept.all() else triangles[is_kept]


def _have_area(points: NDArray[np.floating[Any]], part: NDArray[np.int64] | slice) -> NDArray[np.bool_]:
    """Return for each triangle of a part if it has an area."""
    whole = _of_triangles(points, part) if isinstance(part, slice) else part
    have_area = np.zeros(len(whole), np.bool_)
    for start in range(0, len(whole), _CHUNK_TRIANGLES):
        chunk = slice(start, start + _CHUNK_TRIANGLES)
        corners = whole[chunk] if isinstance(part, slice) else points[part[chunk]]
        # One row for each coordinate: operations on whole rows are several times as fast as on triples.
        a, b, c = np.ascontiguousarray(corners.reshape(-1, 9).T, np.float64).reshape(3, 3, -1)
        sides = [_square(q - p) for p, q in ((a, b), (b, c), (c, a))]
        (ux, uy, uz), (vx, vy, vz) = b - a, c - a
        doubled_area = np.sqrt(_square((uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx)))
        have_area[chunk] = doubled_area > _NO_AREA * np.maximum(np.maximum(sides[0], sides[1]), sides[2])
    return have_area


def _square(vectors: Iterable[NDArray[np.float64]]) -> NDArray[np.float64]:
    x, y, z = vectors
    return x * x + y * y + z * z


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
        # Find the first equal ones of the waiting points by sorting them.
        coordinates = columns[:, waiting]
        order = np.lexsort(coordinates)
        is_new = np.concatenate(([True], (coordinates[:, order[1:]] != coordinates[:, order[:-1]]).any(axis=0)))
        first[waiting[order]] = waiting[order[is_new]][np.cumsum(is_new) - 1]
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
        rows, occupants = waiting[chunk], table[slots[chunk]]
        is_same = np.ones(len(rows), np.bool_)
        for column in columns:
            is_same &= column[occupants] == column[rows]
        first[rows[is_same]] = occupants[is_same]
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


def _order(distinct: Coordinates) -> NDArray[np.intp]:
    """Return the order of distinct points (3, P) by z, then y, then x."""
    if distinct.itemsize != 4:
        return np.lexsort(distinct)
    # Sorting one whole number for z and y is several times as fast as sorting by each of three columns.
    x, y, z = distinct
    key = (_ordinal(z) << 32) + _ordinal(y)
    order = np.argsort(key)
    sorted_keys = key[order]
    is_tie = np.concatenate(([False], sorted_keys[1:] == sorted_keys[:-1], [False]))
    ties = np.flatnonzero(is_tie[1:] | is_tie[:-1])
    tied = order[ties]
    order[ties] = tied[np.lexsort((x[tied], sorted_keys[ties]))]
    return order


def _ordinal(numbers: Coordinates) -> NDArray[np.int64]:
    words = (numbers + numbers.dtype.type(0)).view(np.int32)
    return np.where(words < 0, words ^ 0x7FFFFFFF, words).astype(np.int64)
