"""The mesh that all formats are read into: points and triangles, with limits of size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

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


def mesh_of(points_xyz: NDArray[np.float64], parts: Sequence[NDArray[np.int64]]) -> Mesh:
    """Return the mesh of points and triangles, without those that have no area. Raises MeshError."""
    import numpy as np

    if not is_length(points_xyz):
        raise MeshError("broken-mesh", f"has a coordinate that is not finite or is beyond {_MAX_COORDINATE:g}")
    points, names = _welded(points_xyz)
    kept = [part for part in (_with_area(points, names[part]) for part in parts) if len(part)]
    if not kept:
        found = "none of its triangles has an area" if any(map(len, parts)) else "there is no triangle in it"
        raise MeshError("empty-mesh", f"{found}; export it again, as a surface of triangles")
    used, triangles = compacted(points, np.concatenate(kept))
    ends = np.cumsum([len(part) for part in kept])[:-1]
    return Mesh(used, tuple(np.split(triangles, ends)))


def compacted(
    points_xyz: NDArray[np.float64], triangles: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the points that triangles use, and the triangles as indices of these."""
    import numpy as np

    is_used = np.zeros(len(points_xyz), np.bool_)
    is_used[triangles] = True
    return points_xyz[is_used], (np.cumsum(is_used) - 1)[triangles]


def is_length(coordinates: NDArray[np.float64]) -> bool:
    """Return True if all coordinates are finite and within the limit."""
    import numpy as np

    return bool((np.abs(coordinates) <= _MAX_COORDINATE).all())


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


def _welded(points_xyz: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the distinct points, and the index of each row among them."""
    import numpy as np

    if not len(points_xyz):
        return points_xyz, np.zeros(0, np.int64)
    order = np.lexsort(points_xyz.T)
    rows = points_xyz[order]
    is_new = np.concatenate(([True], (rows[1:] != rows[:-1]).any(axis=1)))
    names = np.empty(len(rows), np.int64)
    names[order] = np.cumsum(is_new) - 1
    return rows[is_new], names


def _with_area(points: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    import numpy as np

    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    sides = np.stack([((q - p) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))])
    doubled_area = np.sqrt((np.cross(b - a, c - a) ** 2).sum(axis=1))
    kept: NDArray[np.int64] = triangles[doubled_area > _NO_AREA * sides.max(axis=0)]
    return kept
