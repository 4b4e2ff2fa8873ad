"""The mesh that all formats are read into: points and triangles, with limits of size."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Final

from sim_action.core.lazy_numpy import NDArray, np
from sim_action.core.records import dataclass

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
    """Return the mesh of points and triangles, without those that have no area. Raises MeshError.

    :param points_xyz: (N, 3) of 32 or 64 bits; equal ones become one.
    :param parts: rows of the points (T, 3); or a slice of triangles, if each triangle has three rows of its own.
    """
    from sim_action.meshes.welding import welded  # it imports this module

    if not is_length(points_xyz):
        raise MeshError("broken-mesh", f"has a coordinate that is not finite or is beyond {_MAX_COORDINATE:g}")
    are_kept = [_have_area(points_xyz, part) for part in parts]
    if not any(is_kept.any() for is_kept in are_kept):
        cause = "none of its triangles has an area" if any(map(len, are_kept)) else "there is no triangle in it"
        raise MeshError("empty-mesh", f"{cause}; export it again, as a surface of triangles")
    points, names = welded(points_xyz)
    found = [_selected(_of_triangles(names, part), is_kept) for part, is_kept in zip(parts, are_kept, strict=True)]
    kept = [part for part in found if len(part)]
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


def is_length(coordinates: NDArray[np.floating[Any]]) -> bool:
    """Return True if all coordinates are finite and within the limit."""
    # The least and the greatest number of an array with a NaN are NaN, too.
    least, greatest = (coordinates.min(), coordinates.max()) if coordinates.size else (0, 0)
    return bool(least >= -_MAX_COORDINATE and greatest <= _MAX_COORDINATE)


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
    found = np.zeros(len(whole), np.bool_)
    for start in range(0, len(whole), _CHUNK_TRIANGLES):
        chunk = slice(start, start + _CHUNK_TRIANGLES)
        corners = whole[chunk] if isinstance(part, slice) else points[part[chunk]]
        # One row for each coordinate: operations on whole rows are several times as fast as on triples.
        a, b, c = np.ascontiguousarray(corners.reshape(-1, 9).T, np.float64).reshape(3, 3, -1)
        sides = [_square(q - p) for p, q in ((a, b), (b, c), (c, a))]
        (ux, uy, uz), (vx, vy, vz) = b - a, c - a
        doubled_area = np.sqrt(_square((uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx)))
        found[chunk] = doubled_area > _NO_AREA * np.maximum(np.maximum(sides[0], sides[1]), sides[2])
    return found


def _square(vectors: Iterable[NDArray[np.float64]]) -> NDArray[np.float64]:
    x, y, z = vectors
    return x * x + y * y + z * z
