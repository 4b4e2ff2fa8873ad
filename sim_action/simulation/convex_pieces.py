"""The collision shapes of links and bodies as convex pieces: the hull of points, rounded by a radius.

A sphere is one point, a capsule two. Cylinders and ellipsoids are hulls of points on their surface. Pieces that are
too many for objects of their own, the triangles of surfaces and terrain, are kept in arrays.

The difference of two convex bodies is convex, and its point nearest to the origin is as far away as the bodies are
apart. It is found by Wolfe's algorithm (1976), which moves from one small simplex of extreme points to the next.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass
from sim_action.meshes.collision_hulls import read_hull_points
from sim_action.robot.model.robot_model import Shape
from sim_action.world.parts import (
    BoxPart,
    CylinderPart,
    GridPart,
    HullPart,
    Part,
    SpherePart,
    SurfacePart,
    grid_surface,
)

_SOLIDS: Final = ("box", "sphere", "cylinder", "capsule", "ellipsoid")
_SIDES: Final = 32
_SIGNS: Final = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


def _directions(count: int) -> FloatArray:
    z = (np.arange(count) + 0.5) / count
    around = np.arange(count) * math.pi * (3 - math.sqrt(5))
    return np.column_stack((np.sqrt(1 - z * z) * np.cos(around), np.sqrt(1 - z * z) * np.sin(around), z))


_DIRECTIONS: Final = np.vstack((np.eye(3), _directions(64)))


@dataclass(frozen=True, eq=False)
class Piece:
    """A convex piece in the frame of its link or body, in m."""

    points: FloatArray  # (P, 3)
    radius: float  # the rounding
    width: float  # its least extent in any direction
    centre: FloatArray  # (3,) the middle of the points
    reach: float  # the greatest distance of its surface from `centre`

    @classmethod
    def of(cls, points: FloatArray, pose: Pose, radius: float = 0.0, width: float | None = None) -> Self:
        """Return the piece of points in a frame at `pose`; `width`: without the rounding, if it is known."""
        if width is None:
            axes = np.linalg.eigh(np.cov(points.T))[1].T if len(points) > 3 else np.eye(3)
            width = float(np.ptp(points @ np.vstack((axes, _DIRECTIONS)).T, axis=0).min())
        placed = turned(points, pose.orientation_xyzw) + pose.position_xyz
        centre = (placed.min(axis=0) + placed.max(axis=0)) / 2
        reach = float(np.sqrt(np.square(placed - centre).sum(axis=1)).max()) + radius
        return cls(placed, radius, width + 2 * radius, centre, reach)

    @property
    def is_ball(self) -> bool:
        """True if turning it about `centre` changes nothing."""
        return len(self.points) == 1

    def extents(self, directions: FloatArray) -> FloatArray:
        """Return its extents (N,) in m along unit vectors (N, 3)."""
        extents: FloatArray = np.ptp(self.points @ directions.T, axis=0) + 2 * self.radius
        return extents


def turned(points: FloatArray, orientation: geometry.Quaternion) -> FloatArray:
    """Return points (P, 3), rotated."""
    columns: Any = tuple(points.T)
    x, y, z = geometry.rotate(orientation, columns)
    return np.column_stack((x, y, z))


def link_pieces(shapes: Sequence[Shape]) -> Iterator[Piece]:
    """Yield the pieces of a link; meshes without hulls have none."""
    for shape in shapes:
        if shape.hulls:
            for points in read_hull_points(shape.hulls):
                yield Piece.of(points, shape.pose)
        elif shape.kind in _SOLIDS:
            middle, half = (
                np.add(shape.upper_xyz, shape.lower_xyz) / 2,
                np.subtract(shape.upper_xyz, shape.lower_xyz) / 2,
            )
            yield _solid(shape.kind, half, geometry.compose(shape.pose, Pose(tuple(middle.tolist()))))


def _solid(kind: str, half: FloatArray, pose: Pose) -> Piece:
    """Return a primitive with these half extents (3,) along its own axes."""
    x, _, z = half.tolist()
    if kind == "sphere":
        return Piece.of(np.zeros((1, 3)), pose, x, 0.0)
    if kind == "capsule":
        straight = max(z - x, 0.0)
        return Piece.of(np.array([[0.0, 0.0, -straight], [0.0, 0.0, straight]]), pose, x, 0.0)
    if kind == "cylinder":
        angles = np.arange(_SIDES) * 2 * math.pi / _SIDES
        rim = np.column_stack((x * np.cos(angles), x * np.sin(angles), np.full(_SIDES, z)))
        return Piece.of(np.vstack((rim, rim * (1, 1, -1))), pose, 0.0, 2 * min(x, z))
    if kind == "ellipsoid":
        return Piece.of(np.vstack((_DIRECTIONS, -_DIRECTIONS)) * half, pose, 0.0, 2 * float(half.min()))
    return Piece.of(_SIGNS * half, pose, 0.0, 2 * float(half.min()))


@dataclass(frozen=True, eq=False)
class Soup:
    """Convex pieces of the same number of corners, (N, P, 3) in m; `groups`: (N,), alike for neighbours."""

    corners: FloatArray
    groups: NDArray[np.int64]


def part_pieces(parts: Sequence[Part]) -> Iterator[Piece]:
    """Yield the convex pieces of a body of the world, but for its surfaces."""
    for part in parts:
        if isinstance(part, BoxPart):
            yield _solid("box", np.array(part.size_xyz) / 2, part.pose)
        elif isinstance(part, CylinderPart):
            yield _solid("cylinder", np.array((part.radius, part.radius, part.height / 2)), part.pose)
        elif isinstance(part, SpherePart):
            yield _solid("sphere", np.full(3, part.radius), part.pose)
        elif isinstance(part, HullPart):
            yield Piece.of(np.array(part.points_xyz), Pose())


def part_soups(parts: Sequence[Part], *, is_solid: bool) -> Iterator[Soup]:
    """Yield the triangles of the surfaces of a body; terrain that `is_solid` has some down to its bottom."""
    for part in parts:
        if isinstance(part, SurfacePart):
            corners = part.points_xyz[part.triangles]
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            steepest = np.abs(normals).argmax(axis=1)
            faces = np.take_along_axis(normals, steepest[:, None], axis=1)[:, 0]
            # One group for each of the six sides to which a triangle can face: a floor is no wall.
            yield Soup(corners, steepest + 3 * (faces > 0))
        elif isinstance(part, GridPart):
            surface = grid_surface(part)
            corners = surface.points_xyz[surface.triangles]
            if is_solid:
                below = corners.copy()
                below[:, :, 2] = part.heights.min() - _TERRAIN_DEPTH_M
                corners = np.concatenate((corners, below), axis=1)
            yield Soup(corners, np.zeros(len(corners), dtype=np.int64))


_TERRAIN_DEPTH_M: Final = 0.1  # MuJoCo's terrain ends this far below its lowest sample


@dataclass(frozen=True, eq=False)
class Obstacle:
    """The N pieces of one or more bodies in one frame."""

    names: tuple[str, ...]  # of the bodies
    lower: FloatArray  # lower, upper: (N, 3) m, their bounding boxes
    upper: FloatArray
    thickness: FloatArray  # thickness, radius: (N,) m
    radius: FloatArray
    groups: NDArray[np.int64]  # (N,); a contact with a piece is a contact with all of its group
    bodies: NDArray[np.int64]  # (N,) the index into `names`
    appears: FloatArray  # appears, disappears: (N,) the steps between which the piece is there; infinite for ever
    disappears: FloatArray
    blocks: tuple[FloatArray, ...]  # the corners of the pieces in their order, (M, P, 3) of each M pieces
    starts: NDArray[np.int64]  # the number of the first piece of each block

    @classmethod
    def of(cls, several: Sequence[tuple[str, tuple[float, float], Pose, Sequence[Piece], Sequence[Soup]]]) -> Self:
        """Return the obstacle of at least one body: name, steps of its presence, pose, pieces and soups of each."""
        blocks = list[FloatArray]()
        columns = list[tuple[int, float, float, int, float, float]]()
        for number, (_, presence, pose, pieces, soups) in enumerate(several):
            for piece in pieces:
                blocks.append((turned(piece.points, pose.orientation_xyzw) + pose.position_xyz)[None])
                columns.append((1, piece.width, piece.radius, number, *presence))
            for soup in soups:
                for group in np.unique(soup.groups).tolist():
                    corners = soup.corners[soup.groups == group]
                    placed = turned(corners.reshape(-1, 3), pose.orientation_xyzw) + pose.position_xyz
                    blocks.append(placed.reshape(corners.shape))
                    columns.append((len(corners), 0.0, 0.0, number, *presence))
        counts = [count for count, *_ in columns]
        _, thickness, radius, bodies, appears, gone = (
            np.repeat(column, counts) for column in zip(*columns, strict=True)
        )
        lower = np.concatenate([block.min(axis=1) for block in blocks]) - radius[:, None]
        upper = np.concatenate([block.max(axis=1) for block in blocks]) + radius[:, None]
        return cls(
            tuple(name for name, *_ in several),
            lower,
            upper,
            thickness,
            radius,
            np.repeat(np.arange(len(blocks)), counts),
            bodies,
            appears,
            gone,
            tuple(blocks),
            np.cumsum([0, *counts[:-1]]),
        )

    def corners(self, index: int) -> FloatArray:
        """Return the corners (P, 3) of a piece."""
        block = int(self.groups[index])
        corners: FloatArray = self.blocks[block][index - int(self.starts[block])]
        return corners

    @cached_property
    def least_thickness(self) -> float:
        """The thickness in m of its thinnest piece."""
        return float(self.thickness.min())

    def near(self, lower: FloatArray, upper: FloatArray, step: int) -> list[int]:
        """Return the pieces that overlap a box (3,), (3,) and are there at a step."""
        inside = (self.lower <= upper).all(axis=1) & (self.upper >= lower).all(axis=1)
        inside &= (self.appears <= step) & (step < self.disappears)
        pieces: list[int] = np.flatnonzero(inside).tolist()
        return pieces


_MAX_ROUNDS: Final = 64
# Relative to the size of the bodies.
_ROUNDING: Final = 1e-12
_MIN_WEIGHT: Final = 1e-12


def hull_distance(one: FloatArray, other: FloatArray, enough: float = math.inf) -> float:
    """Return the distance in m of the hulls of points (P, 3) and (Q, 3), 0 if they overlap; exact up to `enough`."""
    corners = (one[0] - other[0])[None]
    weights = np.ones(1)
    scale = max(float(np.ptp(one, axis=0).max()), float(np.ptp(other, axis=0).max()), float(np.abs(corners).max()))
    nearest = corners[0]
    for _ in range(_MAX_ROUNDS):
        square = float(nearest @ nearest)
        if square <= (_ROUNDING * scale) ** 2:
            return 0.0
        extreme = one[int((one @ nearest).argmin())] - other[int((other @ nearest).argmax())]
        bound = float(nearest @ extreme)
        if bound > 0 and bound / math.sqrt(square) > enough:
            return bound / math.sqrt(square)
        if square - bound <= _ROUNDING * scale * scale or (corners == extreme).all(axis=1).any():
            return math.sqrt(square)
        corners, weights = _nearest_in(np.vstack((corners, extreme)), np.append(weights, 0.0))
        nearest = weights @ corners
        if len(corners) > 3:
            # The origin is inside a simplex.
            break
    return math.sqrt(float(nearest @ nearest))


def _nearest_in(corners: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the corners and weights of the point of a simplex nearest to the origin, without idle corners."""
    while True:
        # The weights, which add up to 1, of the point nearest to the origin in the plane through the corners.
        count = len(corners)
        system = np.zeros((count + 1, count + 1))
        system[0, 1:] = system[1:, 0] = 1.0
        system[1:, 1:] = corners @ corners.T
        right_side = np.zeros(count + 1)
        right_side[0] = 1.0
        best = np.asarray(np.linalg.lstsq(system, right_side, rcond=None)[0][1:], dtype=np.float64)
        if (best > _MIN_WEIGHT).all():
            return corners, best
        falling = best <= _MIN_WEIGHT
        share = float(np.min(weights[falling] / np.maximum(weights[falling] - best[falling], _MIN_WEIGHT)))
        weights = weights + min(share, 1.0) * (best - weights)
        weights[falling & (weights <= weights[falling].min() + _MIN_WEIGHT)] = 0.0
        kept = weights > 0
        corners, weights = corners[kept], weights[kept] / weights[kept].sum()
