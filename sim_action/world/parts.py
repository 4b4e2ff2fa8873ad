"""Parts: the collision shapes of a body of the world, as engines and cameras get them, and their mass properties.

A part is given in the frame of its body, in m. A body of several parts is rigid.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Quaternion, Vector3
from sim_action.core.lazy_numpy import NDArray, np
from sim_action.core.records import dataclass, field, replace

if TYPE_CHECKING:
    from sim_action.world.body import Body


@dataclass(frozen=True, slots=True)
class BoxPart:
    """A box; `pose`: of its centre."""

    size_xyz: Vector3
    pose: Pose = field(default_factory=Pose)


@dataclass(frozen=True, slots=True)
class CylinderPart:
    """A cylinder about the z axis of its own frame, centred there; `pose`: of that frame."""

    radius: float
    height: float
    pose: Pose = field(default_factory=Pose)


@dataclass(frozen=True, slots=True)
class SpherePart:
    """A sphere; `pose`: of its centre."""

    radius: float
    pose: Pose = field(default_factory=Pose)


@dataclass(frozen=True, slots=True)
class HullPart:
    """The convex hull of points (N, 3)."""

    points_xyz: tuple[Vector3, ...]


@dataclass(frozen=True, eq=False)
class GridPart:
    """A surface over a grid about the z axis, with two triangles per cell."""

    size_xy: tuple[float, float]  # extent from the first to the last sample
    heights: NDArray[np.float64]  # (R, C) z; row 0 at the lowest y, column 0 at the lowest x


@dataclass(frozen=True, eq=False)
class SurfacePart:
    """Triangles, possibly hollow or open; `points_xyz`: (P, 3); `triangles`: (T, 3) indices of points."""

    points_xyz: NDArray[np.float64]
    triangles: NDArray[np.int64]


Part = BoxPart | CylinderPart | SpherePart | HullPart | GridPart | SurfacePart


def moved(part: Part, pose: Pose) -> Part:
    """Return a part at another place; `pose`: the pose of its frame. Terrain stays where it is."""
    if pose == Pose() or isinstance(part, GridPart):
        return part
    if isinstance(part, HullPart):
        return HullPart(tuple(geometry.compose(pose, Pose(point)).position_xyz for point in part.points_xyz))
    if isinstance(part, SurfacePart):
        axes = np.array([geometry.rotate(pose.orientation_xyzw, axis) for axis in geometry.AXES])
        return SurfacePart(part.points_xyz @ axes + pose.position_xyz, part.triangles)
    return replace(part, pose=geometry.compose(pose, part.pose))


def lowest(parts: Iterable[Part], orientation: Quaternion) -> float:
    """Return the z in m of the lowest point of a body with this orientation and its origin at 0."""
    return min(_lowest(part, orientation) for part in parts)


def _lowest(part: Part, orientation: Quaternion) -> float:
    # The z axis of the world in the frame of the body.
    x, y, z = geometry.rotate(geometry.conjugate(orientation), (0.0, 0.0, 1.0))
    if isinstance(part, BoxPart | CylinderPart | SpherePart):
        own = geometry.rotate(geometry.conjugate(part.pose.orientation_xyzw), (x, y, z))
        return geometry.dot(part.pose.position_xyz, (x, y, z)) - _half_height(part, own)
    if isinstance(part, HullPart):
        return min(geometry.dot(point, (x, y, z)) for point in part.points_xyz)
    points = grid_points(part) if isinstance(part, GridPart) else part.points_xyz
    return float((points[:, 0] * x + points[:, 1] * y + points[:, 2] * z).min())


def _half_height(part: BoxPart | CylinderPart | SpherePart, up: Vector3) -> float:
    """Return half of the extent of a solid along a direction in its own frame."""
    if isinstance(part, BoxPart):
        return sum(abs(along) * size / 2 for along, size in zip(up, part.size_xyz, strict=True))
    if isinstance(part, CylinderPart):
        return abs(up[2]) * part.height / 2 + part.radius * math.hypot(up[0], up[1])
    return part.radius


def reach(part: Part) -> float:
    """Return an upper bound in m on the distance of a part of a body from the origin of the body."""
    if isinstance(part, BoxPart):
        return math.hypot(*part.pose.position_xyz) + math.hypot(*part.size_xyz) / 2
    if isinstance(part, CylinderPart):
        return math.hypot(*part.pose.position_xyz) + math.hypot(part.radius, part.height / 2)
    if isinstance(part, SpherePart):
        return math.hypot(*part.pose.position_xyz) + part.radius
    points = grid_points(part) if isinstance(part, GridPart) else np.asarray(part.points_xyz)
    return float(np.sqrt(np.square(points).sum(axis=1)).max())


def grid_points(grid: GridPart) -> NDArray[np.float64]:
    """Return the samples (R * C, 3) of a grid, row by row."""
    rows, columns = grid.heights.shape
    width, depth = grid.size_xy
    x = np.tile(np.linspace(-width / 2, width / 2, columns), rows)
    y = np.repeat(np.linspace(-depth / 2, depth / 2, rows), columns)
    return np.column_stack((x, y, grid.heights.ravel()))


def height_at(grid: GridPart, x: float, y: float) -> float | None:
    """Return the z of a grid at a point, on the triangles of `grid_surface`; None outside the grid."""
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
    """Return the triangles of a grid; like in both engines, each cell folds from its lowest x, y to its highest."""
    rows, columns = grid.heights.shape
    corners = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (corners[:-1, :-1], corners[:-1, 1:], corners[1:, 1:], corners[1:, :-1]))
    triangles = np.concatenate((np.column_stack((a, b, c)), np.column_stack((a, c, d))))
    return SurfacePart(grid_points(grid), triangles)


@dataclass(frozen=True, eq=False)
class MassProperties:
    """The mass in kg, the centre of mass in m and the inertia (3, 3) about it in kg m^2, in the axes of the body."""

    mass: float
    centre_xyz: Vector3
    inertia: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Placed:
    """A solid of 1 kg: its volume in m^3, centre of mass, and inertia about that, in the axes of the body."""

    volume: float
    centre: NDArray[np.float64]
    inertia: NDArray[np.float64]


def mass_properties_of(body: Body, parts: Sequence[Part]) -> MassProperties:
    """Return the mass properties of a body with a mass. Where parts overlap, the density is the sum of both."""
    assert body.mass is not None
    middle, uniform = uniform_properties(parts)
    centre = middle if body.center_of_mass is None else np.array(body.center_of_mass)
    inertia = body.mass * uniform if body.inertia is None else np.array(body.inertia.rows)
    x, y, z = centre.tolist()
    return MassProperties(body.mass, (x, y, z), inertia)


def uniform_properties(parts: Sequence[Part]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the centre of mass (3,) of parts of uniform density, and the inertia (3, 3) of 1 kg about it."""
    solids = [_solid(part) for part in parts]
    volumes = np.array([solid.volume for solid in solids])
    shares = volumes / volumes.sum()
    middle: NDArray[np.float64] = np.zeros(3)
    for share, solid in zip(shares, solids, strict=True):
        middle += share * solid.centre
    inertia: NDArray[np.float64] = np.zeros((3, 3))
    for share, solid in zip(shares, solids, strict=True):
        inertia += share * (solid.inertia + displaced(solid.centre - middle))
    return middle, inertia


def displaced(arm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the inertia (3, 3) of 1 kg at a distance (3,) from the axes."""
    inertia: NDArray[np.float64] = (arm @ arm) * np.eye(3) - np.outer(arm, arm)
    return inertia


def _solid(part: Part) -> _Placed:
    if isinstance(part, HullPart):
        from sim_action.meshes.convex_hull import mass_properties  # a usual run does without it

        hull = mass_properties(np.array(part.points_xyz))
        return _Placed(hull.volume, hull.centre_xyz, hull.inertia)
    if isinstance(part, BoxPart):
        return _placed(geometry.box_solid(part.size_xyz), part.pose)
    if isinstance(part, CylinderPart):
        return _placed(geometry.cylinder_solid(part.radius, part.height), part.pose)
    assert isinstance(part, SpherePart), "terrain and surfaces have no mass"
    return _placed(geometry.ellipsoid_solid((part.radius,) * 3), part.pose)


def _placed(solid: geometry.Solid, pose: Pose) -> _Placed:
    inertia = turned_tensor(np.diag(solid.moments), pose.orientation_xyzw)
    return _Placed(solid.volume, np.array(pose.position_xyz), inertia)


def turned_tensor(tensor: NDArray[np.float64], orientation: Quaternion) -> NDArray[np.float64]:
    """Return an inertia tensor (3, 3), stated in axes that have an orientation, in the outer axes."""
    axes = np.array([geometry.rotate(orientation, axis) for axis in geometry.AXES])
    turned: NDArray[np.float64] = axes.T @ tensor @ axes
    return turned


def symmetric(entries: Iterable[float]) -> NDArray[np.float64]:
    """Return the symmetric tensor (3, 3) with these entries: xx, xy, xz, yy, yz, zz."""
    xx, xy, xz, yy, yz, zz = entries
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
