"""Parts: what a body of the world is made of, as engines and cameras see it. No keys, no files, no engine in sight.

A part is in the frame of its body, in m. A body of several parts is rigid; what touches one of them touches the body.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Quaternion, Vector3

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class BoxPart:
    """A box; `pose`: of its middle."""

    size_xyz: Vector3
    pose: Pose = field(default_factory=Pose)


@dataclass(frozen=True, slots=True)
class CylinderPart:
    """About the z axis, its middle at the origin."""

    radius: float
    height: float


@dataclass(frozen=True, slots=True)
class SpherePart:
    """About the origin."""

    radius: float


@dataclass(frozen=True, slots=True)
class HullPart:
    """The convex hull of points."""

    points_xyz: tuple[Vector3, ...]


@dataclass(frozen=True, eq=False)
class GridPart:
    """A surface over a grid about the z axis, each of its cells two triangles.

    Attributes:
        size_xy: from the first to the last sample.
        heights: (R, C) z; row 0 at the lowest y, column 0 at the lowest x.
    """

    size_xy: tuple[float, float]
    heights: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SurfacePart:
    """Triangles as they are, hollow or open; `points_xyz`: (P, 3), `triangles`: (T, 3) rows of these."""

    points_xyz: NDArray[np.float64]
    triangles: NDArray[np.int64]


Part = BoxPart | CylinderPart | SpherePart | HullPart | GridPart | SurfacePart


def lowest(parts: Iterable[Part], orientation: Quaternion) -> float:
    """The z in m of the lowest point of a body that is turned so, with its origin at 0."""
    return min(_lowest(part, orientation) for part in parts)


def _lowest(part: Part, orientation: Quaternion) -> float:
    if isinstance(part, SpherePart):
        return -part.radius
    # Of the z axis of the world, seen from the body.
    x, y, z = geometry.rotate(geometry.conjugate(orientation), (0.0, 0.0, 1.0))
    if isinstance(part, BoxPart):
        own = geometry.rotate(geometry.conjugate(part.pose.orientation_xyzw), (x, y, z))
        half = sum(abs(along) * size / 2 for along, size in zip(own, part.size_xyz, strict=True))
        return _dot(part.pose.position_xyz, (x, y, z)) - half
    if isinstance(part, CylinderPart):
        return -abs(z) * part.height / 2 - part.radius * math.hypot(x, y)
    if isinstance(part, HullPart):
        return min(_dot(point, (x, y, z)) for point in part.points_xyz)
    points = grid_points(part) if isinstance(part, GridPart) else part.points_xyz
    return float((points[:, 0] * x + points[:, 1] * y + points[:, 2] * z).min())


def grid_points(grid: GridPart) -> NDArray[np.float64]:
    """(R * C, 3) the samples of a grid, row by row."""
    import numpy as np

    rows, columns = grid.heights.shape
    width, depth = grid.size_xy
    x = np.tile(np.linspace(-width / 2, width / 2, columns), rows)
    y = np.repeat(np.linspace(-depth / 2, depth / 2, rows), columns)
    return np.column_stack((x, y, grid.heights.ravel()))


def height_at(grid: GridPart, x: float, y: float) -> float | None:
    """The z of a grid there, on the triangles of `grid_surface`; None beside it."""
    rows, columns = grid.heights.shape
    width, depth = grid.size_xy
    across, along = (x / width + 0.5) * (columns - 1), (y / depth + 0.5) * (rows - 1)
    if not (0 <= across <= columns - 1 and 0 <= along <= rows - 1):
        return None
    column, row = min(int(across), columns - 2), min(int(along), rows - 2)
    u, v = across - column, along - row
    (a, b), (d, c) = grid.heights[row : row + 2, column : column + 2].tolist()
    return float(a + u * (b - a) + v * (c - b) if u >= v else a + v * (d - a) + u * (c - d))


def grid_surface(grid: GridPart) -> SurfacePart:
    """The triangles of a grid: each cell is folded from its lowest x and y to its highest, as both engines do."""
    import numpy as np

    rows, columns = grid.heights.shape
    corners = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (corners[:-1, :-1], corners[:-1, 1:], corners[1:, 1:], corners[1:, :-1]))
    triangles = np.concatenate((np.column_stack((a, b, c)), np.column_stack((a, c, d))))
    return SurfacePart(grid_points(grid), triangles)


def _dot(one: Vector3, other: Vector3) -> float:
    (ax, ay, az), (bx, by, bz) = one, other
    return ax * bx + ay * by + az * bz
