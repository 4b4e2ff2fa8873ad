"""The mesh that all formats are read into: points and triangles, with limits of size."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

MAX_BYTES: Final = 60_000_000
"""Limit per file. Text formats need up to 300 bytes per triangle, binary STL 50."""

MAX_TRIANGLES: Final = 500_000
"""Limit per file. Links have up to about 100,000 triangles; reading this many takes one or two seconds."""

MAX_POINTS: Final = 3 * MAX_TRIANGLES
"""Limit per file: three per triangle."""

MAX_PARTS: Final = 10_000
"""Limit per file of objects, solids or instances."""

_MAX_COORDINATE: Final = 1e9
"""Limit of coordinates in the file's units. The largest robot measures 100 m, which is 1e8 micrometres."""

# Area, relative to the squared longest side, below which a triangle is a line.
_NO_AREA: Final = 1e-10

# Triangles at a time: the temporary arrays stay in the processor's cache.
_CHUNK_TRIANGLES: Final = 1 << 14


class MeshError(ValueError):
    """An unusable mesh; the message continues a sentence that starts with the file's name."""

    def __init__(self, rule: str, message: str, line: int | None = None) -> None:
        self.rule, self.message, self.line = rule, message, line
        super().__init__(f"line {line}: {message}" if line else message)


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles with an area.

    Attributes:
        points_xyz: (P, 3) distinct points in the file's units; each is a corner of a triangle.
        parts: (T, 3) each, indices of `points_xyz`; the separate objects of the file.
    """

    points_xyz: NDArray[np.float64]
    parts: tuple[NDArray[np.int64], ...]


def mesh_of(points_xyz: NDArray[np.floating[Any]], parts: Sequence[NDArray[np.int64]]) -> Mesh:
    """Return the mesh of points and triangles, without those that have no area. Raises MeshError.

    :param points_xyz: (N, 3) of 32 or 64 bits; equal ones become one.
    :param parts: (T, 3) each, rows of the points.
    """
    import numpy as np

    from sim_action.meshes.welding import welded

    if not is_length(points_xyz):
        raise MeshError("broken-mesh", f"has a coordinate that is not finite or is beyond {_MAX_COORDINATE:g}")
    kept = [part for part in (_with_area(points_xyz, part) for part in parts) if len(part)]
    if not kept:
        found = "none of its triangles has an area" if any(map(len, parts)) else "there is no triangle in it"
        raise MeshError("empty-mesh", f"{found}; export it again, as a surface of triangles")
    points, names = welded(points_xyz)
    used, triangles = compacted(points, names[kept[0] if len(kept) == 1 else np.concatenate(kept)])
    ends = np.cumsum([len(part) for part in kept])[:-1]
    return Mesh(used, tuple(np.split(triangles, ends)))


def compacted(
    points_xyz: NDArray[np.float64], triangles: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the points that triangles use, and the triangles as indices of these."""
    import numpy as np

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


def refuse_more_triangles(count: int) -> None:
    """Raise MeshError if there are more than are read."""
    if count > MAX_TRIANGLES:
        message = f"has {count:,} triangles or more; at most {MAX_TRIANGLES:,} are read; simplify it: a few thousand"
        raise MeshError("too-large-mesh", f"{message} are enough for collisions")


def refuse_more_points(count: int) -> None:
    """Raise MeshError if there are more than are read."""
    if count > MAX_POINTS:
        raise MeshError("too-large-mesh", f"has {count:,} points or more; at most {MAX_POINTS:,} are read")


def refuse_more_parts(count: int) -> None:
    """Raise MeshError if there are more than are read."""
    if count > MAX_PARTS:
        raise MeshError("too-large-mesh", f"has {count:,} parts or more; at most {MAX_PARTS:,} are read")


def _with_area(points: NDArray[np.floating[Any]], triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    import numpy as np

    starts = range(0, len(triangles), _CHUNK_TRIANGLES)
    chunks = [_have_area(points[triangles[start : start + _CHUNK_TRIANGLES]]) for start in starts]
    kept = np.concatenate(chunks) if chunks else np.zeros(0, np.bool_)
    return triangles if kept.all() else triangles[kept]


def _have_area(corners: NDArray[np.floating[Any]]) -> NDArray[np.bool_]:
    """Return whether each triangle (T, 3, 3) has an area."""
    import numpy as np

    # One row for each coordinate, because operations on whole rows are several times as fast as on triples.
    a, b, c = np.ascontiguousarray(corners.astype(np.float64).transpose(1, 2, 0))
    sides = [_square(q - p) for p, q in ((a, b), (b, c), (c, a))]
    (ux, uy, uz), (vx, vy, vz) = b - a, c - a
    doubled_area = np.sqrt(_square((uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx)))
    found: NDArray[np.bool_] = doubled_area > _NO_AREA * np.maximum(np.maximum(sides[0], sides[1]), sides[2])
    return found


def _square(vectors: Iterable[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the squared length of vectors that are given as rows of x, y and z."""
    x, y, z = vectors
    return x * x + y * y + z * z
