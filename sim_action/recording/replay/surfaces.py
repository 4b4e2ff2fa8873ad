"""Triangle surfaces within a budget: simplification of meshes, hulls and height grids, and their encoding.

Simplification merges the points in each cell of a grid (Rossignac and Borrel 1993, "Multi-resolution 3D approximations
for rendering complex scenes"). It accepts any triangles, open or intersecting ones too, and costs almost nothing.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_action.core.geometry import Vector3
from sim_action.core.records import dataclass
from sim_action.recording.replay.scene_data import MeshData
from sim_action.world.parts import GridPart, SurfacePart, grid_surface

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# The number of cells along the longest side: minimum and maximum.
_COARSEST: Final = 2
_FINEST: Final = 512
_TRIES: Final = 6


@dataclass(frozen=True, eq=False)
class Triangles:
    """A surface: `points_xyz` (P, 3) in m, and `corners` (T, 3), indices of points."""

    points_xyz: FloatArray
    corners: IntArray
    stated: int = 0  # the number of triangles before simplification; 0: these are all

    def __len__(self) -> int:
        return len(self.corners)

    def scaled(self, factors: Vector3) -> Triangles:
        """Return the surface scaled along each axis; corners are reversed if that mirrors it, to keep its outside."""
        mirrors = math.prod(factors) < 0
        corners = self.corners[:, ::-1] if mirrors else self.corners
        return Triangles(self.points_xyz * np.array(factors), corners, self.stated)

    @property
    def size(self) -> float:
        """The diagonal of the bounding box in m."""
        return float(np.linalg.norm(np.ptp(self.points_xyz, axis=0))) if len(self.points_xyz) else 0.0


def simplified(surface: Triangles, most: int) -> Triangles:
    """Return a surface with at most `most` triangles, as fine as possible."""
    if len(surface) <= most:
        return surface
    low, high, best = _COARSEST, _FINEST, None
    # The number of triangles grows with the square of the number of cells along a side.
    cells = int(math.sqrt(most / 6))
    for _ in range(_TRIES):
        cells = max(low, min(high, cells))
        tried = _clustered(surface, cells)
        if len(tried) <= most:
            best, low = tried, cells + 1
        else:
            high = cells - 1
        if low > high or (best is tried and len(tried) > 0.8 * most):
            break
        cells = max(low, min(high, int(cells * math.sqrt(most / max(1, len(tried))))))
    kept = best or _first(_clustered(surface, _COARSEST), most)
    return Triangles(kept.points_xyz, kept.corners, surface.stated or len(surface))


def _clustered(surface: Triangles, cells: int) -> Triangles:
    """Merge the points in each cell of a grid; `cells` is their number along the longest side of the bounding box."""
    points = surface.points_xyz
    lower = points.min(axis=0)
    size = float(np.ptp(points, axis=0).max()) / cells or 1.0
    places = np.minimum(((points - lower) / size).astype(np.int64), cells)
    keys = (places[:, 0] * (cells + 1) + places[:, 1]) * (cells + 1) + places[:, 2]
    _, names, counts = np.unique(keys, return_inverse=True, return_counts=True)
    names = names.ravel()
    sums = [np.bincount(names, weights=points[:, axis]) for axis in range(3)]
    return without_idle(Triangles(np.column_stack(sums) / counts[:, None], names[surface.corners]))


def without_idle(surface: Triangles) -> Triangles:
    """Remove degenerate and duplicate triangles, and points without a triangle."""
    a, b, c = surface.corners.T
    kept = surface.corners[(a != b) & (b != c) & (a != c)]
    # Rotate corners so that the smallest comes first; the outside stays the same.
    turns = kept.argmin(axis=1)[:, None]
    kept = np.take_along_axis(kept, (turns + np.arange(3)) % 3, axis=1)
    kept = _distinct(kept)[0] if len(kept) else kept
    used, corners = np.unique(kept, return_inverse=True)
    return Triangles(surface.points_xyz[used], corners.reshape(-1, 3).astype(np.int64))


def _distinct(rows: IntArray) -> tuple[IntArray, IntArray]:
    """Return the distinct rows (N, 3) in order, and the number of each row among them, as `numpy.unique` does."""
    lower = rows.min(axis=0)
    x, y, z = (rows - lower).T
    _, wide, deep = (rows.max(axis=0) - lower + 1).tolist()
    # One number for each row is sorted several times as fast; it has 63 bits for 2 million values in each column.
    _, firsts, names = np.unique((x * wide + y) * deep + z, return_index=True, return_inverse=True)
    return rows[firsts], names.ravel()


def _first(surface: Triangles, most: int) -> Triangles:
    return without_idle(Triangles(surface.points_xyz, surface.corners[:most]))


# Points of all hulls of a shape, and the least and the most of each: to find the faces takes 0.1 ms a point.
_MAX_HULL_POINTS: Final = 512
_MIN_POINTS_OF_HULL: Final = 12
_MAX_POINTS_OF_HULL: Final = 64


def hull_surface(hulls: Sequence[FloatArray]) -> Triangles | None:
    """The surface of several hulls, each of points (P, 3); None if none of them has a volume."""
    most = min(_MAX_POINTS_OF_HULL, max(_MIN_POINTS_OF_HULL, _MAX_HULL_POINTS // max(1, len(hulls))))
    surfaces = [surface for surface in (_one_hull(points, most) for points in hulls) if surface is not None]
    if not surfaces:
        return None
    above = np.cumsum([0, *(len(surface.points_xyz) for surface in surfaces)])
    corners = [surface.corners + before for surface, before in zip(surfaces, above[:-1], strict=True)]
    return Triangles(np.concatenate([surface.points_xyz for surface in surfaces]), np.concatenate(corners))


def _one_hull(points: FloatArray, most: int) -> Triangles | None:
    from sim_action.meshes.convex_hull import hull_faces  # a usual run does without it
    from sim_action.sensors.rendering.solids import outermost  # a usual run does without it

    middle = points.mean(axis=0)
    kept = outermost(points - middle, most)
    faces = hull_faces(kept)
    return None if faces is None else Triangles(kept + middle, _outwards(kept, faces.astype(np.int64)))


def _outwards(points: FloatArray, faces: IntArray) -> IntArray:
    """Return the faces of a hull with their corners counter-clockwise, seen from outside."""
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    inwards = ((a - points.mean(axis=0)) * np.cross(b - a, c - a)).sum(axis=1) < 0
    turned = faces.copy()
    turned[inwards] = faces[inwards][:, ::-1]
    return turned


MAX_GRID_SAMPLES: Final = 48  # the largest number of samples along a side of a height grid: 4,418 triangles


def coarse_surface(grid: GridPart) -> Triangles:
    """Return the surface of a height grid, resampled to at most `MAX_GRID_SAMPLES` along a side."""
    rows, columns = grid.heights.shape
    heights = _resampled(_resampled(grid.heights, min(rows, MAX_GRID_SAMPLES)).T, min(columns, MAX_GRID_SAMPLES)).T
    surface: SurfacePart = grid_surface(GridPart(grid.size_xy, np.ascontiguousarray(heights)))
    return Triangles(surface.points_xyz, surface.triangles)


def _resampled(heights: FloatArray, count: int) -> FloatArray:
    """Return `count` evenly spaced rows by linear interpolation."""
    places = np.linspace(0, len(heights) - 1, count)
    below = np.minimum(places.astype(np.int64), len(heights) - 2)
    share = (places - below)[:, None]
    resampled: FloatArray = heights[below] * (1 - share) + heights[below + 1] * share
    return resampled


_MIN_TRIANGLES: Final = 12  # each mesh may have at least the triangles of a box
_MESH_STEPS: Final = 2**10  # the resolution of a mesh along its longest side: 1 mm for 1 m
_MIN_STEP_M: Final = 1e-5  # the finest resolution of a mesh


@dataclass(frozen=True, slots=True)
class Budget:
    """The largest number of triangles of each mesh and of all of a replay; each takes 4 bytes of the report."""

    per_mesh: int
    all: int


ROBOT_BUDGET: Final = Budget(2_400, 8_000)
WORLD_BUDGET: Final = Budget(4_500, 8_000)


def within(budget: Budget, surfaces: Sequence[Triangles]) -> list[Triangles]:
    """Simplify surfaces to a budget: those with few triangles are kept, the others share the rest by their size."""
    limits = [min(len(surface), budget.per_mesh) for surface in surfaces]
    # A surface without an extent counts as a very small one.
    sizes = [max(surface.size, 1e-9) if np.isfinite(surface.points_xyz).all() else 1e-9 for surface in surfaces]
    most, left, above = list(limits), budget.all, sum(sizes)
    # First those whose triangles are few for their size.
    for place in sorted(range(len(surfaces)), key=lambda place: limits[place] / sizes[place]):
        share = max(_MIN_TRIANGLES, int(left * sizes[place] / above))
        most[place] = min(limits[place], share)
        left, above = max(0, left - most[place]), above - sizes[place]
    return [simplified(surface, count) for surface, count in zip(surfaces, most, strict=True)]


def mesh_data(surface: Triangles) -> MeshData | None:
    """Encode a surface; None if no triangle is left."""
    points = surface.points_xyz
    if not len(surface) or not np.isfinite(points).all():
        return None
    step = max(_MIN_STEP_M, float(np.ptp(points, axis=0).max()) / _MESH_STEPS)
    places = np.rint(points / step).astype(np.int64)
    grid, names = _distinct(places)
    whole = without_idle(Triangles(grid.astype(np.float64), names.ravel()[surface.corners]))
    if not len(whole):
        return None
    return MeshData.encoded(whole.points_xyz.astype(np.int64), whole.corners, float(f"{step:.6g}"))


def digest_of(mesh: MeshData) -> str:
    """Return a digest that is equal for equal meshes."""
    return hashlib.sha256(repr((mesh.scale, mesh.points, mesh.triangles)).encode()).hexdigest()[:16]
