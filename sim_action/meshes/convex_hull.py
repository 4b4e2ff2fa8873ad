"""The convex hull of points: faces, normals, mass properties, and the selection of its outer points."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_action.core.geometry import Vector3
from sim_action.core.records import dataclass

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
_FLAT: Final = 1e-6  # tolerance relative to the extent: nearer points lie on a plane
_PRODUCTS_AT_A_TIME: Final = 1 << 14  # directions times points: the temporary arrays stay in the processor's cache
_MIN_POINTS_FOR_CELLS: Final = 10_000  # fewer points are searched one direction after the other, which is as fast
# The search for distant points: 40^3 cells have numbers of 16 bits, and 56 groups of directions are not empty.
_MAX_CELLS_ALONG_AXIS: Final = 40
_GROUPS_ALONG_AXIS: Final = 4
_ROUNDING: Final = 1e-14  # relative to the largest coordinate; more than the rounding of a sum of three products


@dataclass(frozen=True, eq=False)
class MassProperties:
    """The centre of mass in m, and the inertia about it in kg m^2, of a body of 1 kg, in its own axes."""

    centre_xyz: FloatArray
    inertia: FloatArray
    volume: float  # in m^3


def mass_properties(points: FloatArray) -> MassProperties:
    """Return the mass properties of the hull of points (N, 3), which must have a volume and uniform density."""
    inside = points.mean(axis=0)
    faces = hull_faces(points - inside)
    assert faces is not None
    a, b, c = (points[faces[:, corner]] - inside for corner in range(3))
    volumes = np.abs((a * np.cross(b, c)).sum(axis=1)) / 6
    share = volumes / volumes.sum()
    centre = (share[:, None] * (a + b + c) / 4).sum(axis=0)
    # The second moments of a tetrahedron with a corner at the origin: (the corners' and their sum's) / 20.
    sums = sum(np.einsum("t,ti,tj->ij", share, corner, corner) for corner in (a, b, c, a + b + c)) / 20
    moments = sums - np.outer(centre, centre)
    return MassProperties(inside + centre, np.trace(moments) * np.eye(3) - moments, float(volumes.sum()))


def face_normals(points: FloatArray) -> FloatArray:
    """Return the outward unit normals (F, 3) of a hull's faces; none without a volume."""
    faces = hull_faces(points)
    return np.empty((0, 3)) if faces is None else _planes(points, faces, points.mean(axis=0))[0]


def hull_faces(points: FloatArray) -> IntArray | None:
    """Return the points (F, 3) of each face of a hull, built point by point; None without a volume."""
    eps = _FLAT * float(np.abs(points).max())
    corners = _first_corners(points, eps)
    if corners is None:
        return None
    inside = points[list(corners)].mean(axis=0)
    a, b, c, d = corners
    faces = np.array([(a, b, c), (a, b, d), (a, c, d), (b, c, d)])
    normals, offsets = _planes(points, faces, inside)
    for number, point in enumerate(points):
        seen = along(normals, point) > offsets + eps
        if seen.any():
            # The edges (E, 2) that belong to only one of the faces.
            edges = np.sort(faces[seen][:, [(0, 1), (1, 2), (2, 0)]].reshape(-1, 2), axis=1)
            unique_edges, counts = np.unique(edges, axis=0, return_counts=True)
            rim: IntArray = unique_edges[counts == 1]
            grown = np.column_stack((rim, np.full(len(rim), number)))
            new_normals, new_offsets = _planes(points, grown, inside)
            faces = np.concatenate((faces[~seen], grown))
            normals = np.concatenate((normals[~seen], new_normals))
            offsets = np.concatenate((offsets[~seen], new_offsets))
    return faces


def _planes(points: FloatArray, faces: IntArray, inside: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return normals (F, 3), away from a point inside, and offsets (F,)."""
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.sqrt((normals**2).sum(axis=1))
    normals /= np.where(lengths > 0, lengths, 1.0)[:, None]
    normals *= np.where(((a - inside) * normals).sum(axis=1) < 0, -1.0, 1.0)[:, None]
    return normals, (a * normals).sum(axis=1)


def _first_corners(points: FloatArray, eps: float) -> tuple[int, int, int, int] | None:
    """Return four points that are far from a common plane; None if all points lie in one."""
    a = int(points[:, 0].argmin())
    away = points - points[a]
    b = int((away**2).sum(axis=1).argmax())
    across = np.cross(away, away[b])
    c = int((across**2).sum(axis=1).argmax())
    heights = np.abs(along(away, np.cross(away[b], away[c])))
    d = int(heights.argmax())
    area = float(np.sqrt((np.cross(away[b], away[c]) ** 2).sum()))
    return (a, b, c, d) if heights[d] > eps * area else None


def along(points: FloatArray, direction: FloatArray) -> FloatArray:
    """Return the positions of points along a direction, as sums of products: the same on every machine."""
    length: FloatArray = points[..., 0] * direction[0] + points[..., 1] * direction[1] + points[..., 2] * direction[2]
    return length


def furthest(points: FloatArray, directions: Iterable[Vector3]) -> FloatArray:
    """Return the most distant of points (N, 3) in each direction, with extents normalized first."""
    columns = np.ascontiguousarray(points.T)
    extents = np.ptp(columns, axis=1, keepdims=True)
    columns /= np.where(extents > 0, extents, 1.0)
    vectors = np.array(list(directions), np.float64)
    kept: FloatArray = points[sorted(set(_most_distant(columns, vectors)))]
    return kept


def _most_distant(columns: FloatArray, directions: FloatArray) -> Iterator[int]:
    """Yield the first of the most distant points (3, N) in each direction (D, 3), as a search of all points would.

    The points are sorted into cells, and the directions into groups. A group searches only the cells whose box reaches
    as far as a point that is already known.
    """
    if columns.shape[1] < _MIN_POINTS_FOR_CELLS:
        yield from _search(columns, directions)
        return
    order, starts = _by_cell(columns, _cells_along_axis(columns.shape[1]))
    counts = np.diff(starts, append=len(order))
    lower, upper = (extreme.reduceat(columns[:, order], starts, axis=1) for extreme in (np.minimum, np.maximum))
    slack = _ROUNDING * float(np.abs(columns).max())
    turned, groups = _by_cell(directions.T, _GROUPS_ALONG_AXIS)
    for group in np.split(directions[turned], groups[1:]):
        reach = _reach(lower, upper, group)
        known_points = columns.take(_members(order, starts, counts, np.unique(reach.argmax(axis=1))), axis=1)
        most = _reach(known_points, known_points, group).max(axis=1, keepdims=True)
        near = np.sort(_members(order, starts, counts, np.flatnonzero((reach >= most - slack).any(axis=0))))
        yield from (int(near[row]) for row in _search(columns.take(near, axis=1), group))


def _search(columns: FloatArray, directions: FloatArray) -> Iterator[int]:
    """Yield the first of the most distant points (3, N) in each direction (D, 3); all points are searched."""
    at_a_time = max(1, _PRODUCTS_AT_A_TIME // columns.shape[1])
    for start in range(0, len(directions), at_a_time):
        x, y, z = directions[start : start + at_a_time].T[..., None]
        # The sums of `along`.
        yield from (columns[0] * x + columns[1] * y + columns[2] * z).argmax(axis=1).tolist()


def _reach(lower: FloatArray, upper: FloatArray, directions: FloatArray) -> FloatArray:
    """Return how far boxes, given by two corners (3, C), reach in each direction (D, 3): (D, C)."""
    reach = np.zeros((len(directions), lower.shape[1]))
    for axis, ahead in enumerate(directions.T[..., None]):
        reach += np.maximum(lower[axis] * ahead, upper[axis] * ahead)
    return reach


def _cells_along_axis(points: int) -> int:
    return min(_MAX_CELLS_ALONG_AXIS, max(1, round(math.sqrt(points / 360))))


def _by_cell(columns: FloatArray, count: int) -> tuple[IntArray, IntArray]:
    """Return an order of points (3, N) in which the points of a cell are neighbours, and the start of each cell."""
    lower = columns.min(axis=1, keepdims=True)
    extents = np.ptp(columns, axis=1, keepdims=True)
    steps = ((columns - lower) * (0.999999 * count / np.where(extents > 0, extents, 1.0))).astype(np.uint16)
    cells = (steps[0] * np.uint16(count) + steps[1]) * np.uint16(count) + steps[2]
    # A stable sort of whole numbers of 16 bits takes linear time.
    order = np.argsort(cells, kind="stable")
    ordered = cells[order]
    return order, np.flatnonzero(np.concatenate(([True], ordered[1:] != ordered[:-1])))


def _members(order: IntArray, starts: IntArray, counts: IntArray, cells: IntArray) -> IntArray:
    """Return the points of some cells."""
    ends = np.cumsum(counts[cells])
    rows = np.repeat(starts[cells] + counts[cells] - ends, counts[cells]) + np.arange(ends[-1])
    members: IntArray = order[rows]
    return members


def spread_directions(count: int) -> Iterator[Vector3]:
    """Yield unit vectors that are spread evenly over the sphere, along a spiral."""
    golden_angle = math.pi * (3 - math.sqrt(5))
    for nth in range(count):
        height = 1 - (2 * nth + 1) / count
        radius = math.sqrt(1 - height * height)
        yield (radius * math.cos(golden_angle * nth), radius * math.sin(golden_angle * nth), height)
