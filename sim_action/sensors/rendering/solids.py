"""The pinhole camera, its rays, and the solids that they hit: ellipsoid, cylinder, capsule, polyhedron and triangle."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import ClassVar, Final, Self

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Vector3
from sim_action.core.records import dataclass, delegated
from sim_action.meshes.collision_hulls import read_hull_points
from sim_action.meshes.convex_hull import along, face_normals, furthest, spread_directions

FloatArray = NDArray[np.float64]
Components = tuple[FloatArray, FloatArray, FloatArray]  # x, y and z of many vectors; each array broadcasts to (H, W)
Patch = tuple[slice, slice]  # rows and columns of a picture


@dataclass(frozen=True, slots=True)
class Rays:
    """Rays of a patch of a picture, in the frame of a solid."""

    start_xyz: Vector3  # common start in m
    ways: Components  # directions, in m per metre along the view

    def points(self, depth: FloatArray) -> Components:
        """Return the points of the rays at a depth in m."""
        (ax, ay, az), (x, y, z) = self.start_xyz, self.ways
        return ax + depth * x, ay + depth * y, az + depth * z


@dataclass(frozen=True)
class Pinhole:
    """A camera that looks along its x axis, with y to the left and z up; its pixels are square."""

    width: int  # width, height: pixels
    height: int
    field_of_view: float  # rad, from the left edge to the right one
    near: float  # near, far: limits of the picture in m along the view
    far: float

    @property
    def focal_length(self) -> float:
        """The focal length in pixels."""
        return self.width / 2 / math.tan(self.field_of_view / 2)

    @cached_property
    def left(self) -> FloatArray:
        """The slope to the left, (1, W), of the ray through the centre of each column."""
        return _across(self.width, self.focal_length)[None, :]

    @cached_property
    def up(self) -> FloatArray:
        """The upward slope, (H, 1), of the ray through the centre of each row."""
        return _across(self.height, self.focal_length)[:, None]

    def rays(self, camera: Pose, patch: Patch) -> Rays:
        """Return the rays of a patch in a frame; `camera`: pose of the camera in that frame."""
        rows, columns = patch
        left, up = self.left[:, columns], self.up[rows]
        axes = (geometry.rotate(camera.orientation_xyzw, unit) for unit in geometry.AXES)
        # Sums of products instead of a matrix product: the same on every machine.
        x, y, z = (ahead + to_left * left + upwards * up for ahead, to_left, upwards in zip(*axes, strict=True))
        return Rays(camera.position_xyz, (x, y, z))

    def patch_around(self, middle_xyz: Vector3, radius: float) -> Patch | None:
        """Return the patch that covers a sphere, given in the camera's frame; None if it is not visible."""
        x, y, z = middle_xyz
        # Written so that NaN, as in a diverged simulation, is not visible.
        if not (x + radius >= self.near and x - radius <= self.far):
            return None
        if x - radius <= self.near:
            return slice(0, self.height), slice(0, self.width)
        columns = _span(y, x, radius, self.focal_length, self.width)
        rows = _span(z, x, radius, self.focal_length, self.height)
        return None if columns.start >= columns.stop or rows.start >= rows.stop else (rows, columns)


def _across(count: int, focal_length: float) -> FloatArray:
    across: FloatArray = (count / 2 - 0.5 - np.arange(count, dtype=np.float64)) / focal_length
    return across


def _span(across: float, ahead: float, radius: float, focal_length: float, count: int) -> slice:
    """Return the columns or rows that a sphere in front of the camera may cover, from its bounding box."""
    near, far = ahead - radius, ahead + radius
    low, high = across - radius, across + radius
    most = high / (near if high > 0 else far)
    least = low / (far if low > 0 else near)
    first, last = (min(max(count / 2 - 0.5 - way * focal_length, -1.0), float(count)) for way in (most, least))
    return slice(max(0, math.floor(first)), min(count, math.ceil(last) + 1))


Entry = tuple[FloatArray, Components]
"""The depth in m at which each ray enters (inf: it misses) and the outward unit normal there."""


class Solid(ABC):
    """A convex solid. Callers of `enter` must wrap it in np.errstate(divide="ignore", invalid="ignore")."""

    @property
    @abstractmethod
    def radius(self) -> float:
        """The radius in m of the bounding sphere about the origin."""

    @abstractmethod
    def enter(self, rays: Rays) -> Entry:
        """Return where rays enter from outside; negative depths are behind their start."""


@dataclass(frozen=True)
class Ellipsoid(Solid):
    """An ellipsoid or a sphere; `half_xyz`: its half axes in m."""

    half_xyz: Vector3

    @property
    @override
    def radius(self) -> float:
        return max(self.half_xyz)

    @override
    def enter(self, rays: Rays) -> Entry:
        start, ways = _scaled(rays, self.half_xyz)
        depth, _ = _through(_dot(ways, ways), _dot(start, ways), sum(part * part for part in start) - 1)
        x, y, z = rays.points(depth)
        a, b, c = self.half_xyz
        return depth, _unit((x / a**2, y / b**2, z / c**2))


@dataclass(frozen=True)
class Cylinder(Solid):
    """A cylinder about the z axis; `across`: its radius in m."""

    across: float
    half_length: float

    @property
    @override
    def radius(self) -> float:
        return math.hypot(self.across, self.half_length)

    @override
    def enter(self, rays: Rays) -> Entry:
        side, side_end = _side(rays, self.across)
        cap, cap_end = _slab(rays.start_xyz[2], rays.ways[2], self.half_length)
        depth = np.maximum(side, cap)
        depth = np.where(depth <= np.minimum(side_end, cap_end), depth, np.inf)
        x, y, _ = rays.points(depth)
        on_cap = cap >= side
        nx, ny = (np.where(on_cap, 0.0, across / self.across) for across in (x, y))
        return depth, (nx, ny, np.where(on_cap, -np.sign(rays.ways[2]), 0.0))


@dataclass(frozen=True)
class Capsule(Solid):
    """A cylinder about the z axis with a hemisphere on each end; `half_length`: of the cylinder only."""

    across: float
    half_length: float

    @property
    @override
    def radius(self) -> float:
        return self.across + self.half_length

    @override
    def enter(self, rays: Rays) -> Entry:
        ball = Ellipsoid((self.across,) * 3)
        side, _ = _side(rays, self.across)
        _, _, z = rays.points(side)
        ax, ay, az = rays.start_xyz
        balls = (Rays((ax, ay, az - end), rays.ways) for end in (self.half_length, -self.half_length))
        depths = [np.where(np.abs(z) <= self.half_length, side, np.inf), *(ball.enter(seen)[0] for seen in balls)]
        depth = np.minimum.reduce(depths)
        x, y, z = rays.points(depth)
        return depth, _unit((x, y, z - np.clip(z, -self.half_length, self.half_length)))


@dataclass(frozen=True)
class Polyhedron(Solid):
    """An intersection of half spaces: outward `normals` (P, 3) at `offsets` (P,) in m from the origin."""

    normals: FloatArray
    offsets: FloatArray
    reach: float

    @classmethod
    def box(cls, half_xyz: Vector3) -> Polyhedron:
        """Return a box about the origin."""
        normals = np.concatenate((np.eye(3), -np.eye(3)))
        return cls(normals, np.array([*half_xyz, *half_xyz]), math.hypot(*half_xyz))

    radius: ClassVar[float] = delegated("reach")

    @override
    def enter(self, rays: Rays) -> Entry:
        shape = np.broadcast_shapes(*(way.shape for way in rays.ways))
        entry, leaving = np.full(shape, -np.inf), np.full(shape, np.inf)
        face = np.zeros(shape, dtype=np.intp)
        for number, (normal, offset) in enumerate(zip(self.normals.tolist(), self.offsets.tolist(), strict=True)):
            towards = _dot(normal, rays.ways)
            above = _above(normal, offset, rays.start_xyz)
            depth = -above / towards
            if above > 0:
                # The start is outside this plane, so rays can only enter through it.
                depth[towards >= 0] = np.inf
                face[depth > entry] = number
                np.maximum(entry, depth, out=entry)
            else:
                depth[towards <= 0] = np.inf
                np.minimum(leaving, depth, out=leaving)
        x, y, z = self.normals.T
        return np.where(entry <= leaving, entry, np.inf), (x[face], y[face], z[face])


def _side(rays: Rays, radius: float) -> tuple[FloatArray, FloatArray]:
    """Return where rays enter and leave an infinite cylinder about the z axis."""
    (ax, ay, _), (x, y, _) = rays.start_xyz, rays.ways
    distance = ax * ax + ay * ay - radius * radius
    entry, leaving = _through(x * x + y * y, ax * x + ay * y, distance)
    if distance > 0:
        return entry, leaving
    # The start is inside: rays along the axis never leave, others entered before.
    along = (x == 0) & (y == 0)
    return np.where(along, -np.inf, entry), np.where(along, np.inf, leaving)


def _slab(start: float, way: FloatArray, half: float) -> tuple[FloatArray, FloatArray]:
    one, other = (-half - start) / way, (half - start) / way
    along, outside = way == 0, abs(start) > half
    entry = np.where(along, np.inf if outside else -np.inf, np.minimum(one, other))
    return entry, np.where(along, np.inf, np.maximum(one, other))


def _through(a: FloatArray, b: FloatArray, c: float) -> tuple[FloatArray, FloatArray]:
    """Return both solutions t of a t^2 + 2 b t + c = 0; inf where there are none."""
    root = np.sqrt(b * b - a * c)
    first, second = (-b - root) / a, (-b + root) / a
    missed = np.isnan(first)
    return np.where(missed, np.inf, first), np.where(missed, np.inf, second)


def _scaled(rays: Rays, half_xyz: Vector3) -> tuple[Vector3, Components]:
    (ax, ay, az), (x, y, z), (a, b, c) = rays.start_xyz, rays.ways, half_xyz
    return (ax / a, ay / b, az / c), (x / a, y / b, z / c)


def _dot(one: Sequence[float] | Components, other: Components) -> FloatArray:
    (ax, ay, az), (bx, by, bz) = one, other
    product: FloatArray = ax * bx + ay * by + az * bz
    return product


def _above(normal: Sequence[float], offset: float, point_xyz: Vector3) -> float:
    return sum(one * other for one, other in zip(normal, point_xyz, strict=True)) - offset


def _unit(vector: Components) -> Components:
    x, y, z = vector
    length = np.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


@dataclass(frozen=True)
class Triangle(Solid):
    """A triangle that is seen from both sides."""

    corners: FloatArray
    normal_xyz: Vector3  # unit normal
    edges: FloatArray  # (3, 3) vectors in its plane, outwards from each side

    @classmethod
    def centred(cls, corners: FloatArray) -> tuple[Self, Vector3]:
        """Return the triangle with these corners (3, 3) about its centre, and that centre."""
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
        own = corners - middle
        normal = np.cross(own[1] - own[0], own[2] - own[0])
        normal /= np.linalg.norm(normal)
        edges = np.cross(np.roll(own, -1, axis=0) - own, normal)
        nx, ny, nz = normal.tolist()
        x, y, z = middle.tolist()
        return cls(own, (nx, ny, nz), edges), (x, y, z)

    @property
    @override
    def radius(self) -> float:
        return float(np.linalg.norm(self.corners, axis=1).max())

    @override
    def enter(self, rays: Rays) -> Entry:
        nx, ny, nz = self.normal_xyz
        wx, wy, wz = rays.ways
        towards = nx * wx + ny * wy + nz * wz
        starts = zip(self.normal_xyz, rays.start_xyz, self.corners[0].tolist(), strict=True)
        above = sum(across * (start - corner) for across, start, corner in starts)
        depth = -above / towards
        x, y, z = rays.points(depth)
        missed = ~np.isfinite(depth)
        for corner, (ex, ey, ez) in zip(self.corners.tolist(), self.edges.tolist(), strict=True):
            missed |= ex * (x - corner[0]) + ey * (y - corner[1]) + ez * (z - corner[2]) > 0
        side = -np.sign(towards)
        return np.where(missed, np.inf, depth), (nx * side, ny * side, nz * side)


_MARGIN_M: Final = 0.001  # the margin in m by which clean meshes are shrunk (see robot.audit.links)
# The most distant points in as many directions; the error of a sphere is at most 4 % of its radius.
MAX_HULL_POINTS: Final = 64


def read_hull_polyhedra(text: bytes) -> Iterator[tuple[Polyhedron, Vector3]]:
    """Return the hulls of a clean mesh, each about its centre, with that centre."""
    return (centred_hull(points, _MARGIN_M) for points in read_hull_points(text))


def centred_hull(points: FloatArray, margin: float = 0.0) -> tuple[Polyhedron, Vector3]:
    """Return the hull of points (N, 3) about its centre, and that centre."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    x, y, z = middle.tolist()
    return hull_polyhedron(points - middle, margin), (x, y, z)


def hull_polyhedron(points: FloatArray, margin: float = 0.0) -> Polyhedron:
    """Return the hull of points (N, 3) with a margin around it; it contains all points, even of a flat hull.

    Only the directions of its planes come from the faces of the hull. The offsets come from all points.
    """
    middle = points.mean(axis=0)
    normals = np.concatenate((np.eye(3), -np.eye(3), face_normals(outermost(points - middle))))
    _, first = np.unique(normals.round(6), axis=0, return_index=True)
    normals = normals[np.sort(first)]
    offsets = np.array([along(points, normal).max() for normal in normals]) + margin
    reach = float(np.sqrt((points**2).sum(axis=1)).max()) + 2 * margin
    return Polyhedron(normals, offsets, reach)


def outermost(points: FloatArray, most: int = MAX_HULL_POINTS) -> FloatArray:
    """Return the most distant of points (N, 3) about their centre; all points if they are few."""
    if len(points) <= most:
        return points
    return furthest(points, spread_directions(most))
