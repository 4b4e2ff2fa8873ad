"""What is seen of links and bodies in a replay: plain solids, and meshes that several may share."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from sim_action.core.field_types import FrozenModel

IntArray = NDArray[np.int64]

MAX_SHAPES: Final = 5_000
"""Of one link or body; a map has at most 2,000 walls."""

MAX_POINTS: Final = 40_000
"""Of a mesh."""

FARTHEST: Final = 1e9
"""Of any number, in its unit."""

Number = Annotated[float, Field(ge=-FARTHEST, le=FARTHEST, allow_inf_nan=False)]
Length = Annotated[float, Field(ge=0, le=FARTHEST, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1)]

Place = tuple[Number, Number, Number]
"""x, y, z in m."""

PoseNumbers = tuple[Number, Number, Number, Number, Number, Number, Number]
"""x, y, z in m, then the quaternion x, y, z, w."""


def numbers(values: Iterable[float]) -> tuple[float, ...]:
    """To a hundredth of a millimetre, and turns to as little: what a page shows needs no more, and it packs better."""
    return tuple(round(value, 5) for value in values)


Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{16,64}$")]
Coordinates = Annotated[
    tuple[Annotated[int, Field(ge=-(2**31), le=2**31)], ...], Field(min_length=9, max_length=3 * MAX_POINTS)
]
Corners = Annotated[
    tuple[Annotated[int, Field(gt=-MAX_POINTS, lt=MAX_POINTS)], ...], Field(min_length=3, max_length=6 * MAX_POINTS)
]


class _Shape(FrozenModel):
    """A shape in the frame of what it is part of; `color`: red, green, blue, 0 to 1."""

    pose: PoseNumbers
    color: tuple[Share, Share, Share]


class BoxShape(_Shape):
    """A box of full sizes in m, about its middle."""

    kind: Literal["box"]
    size: tuple[Length, Length, Length]


class CylinderShape(_Shape):
    """About its z axis and its middle, in m."""

    kind: Literal["cylinder"]
    radius: Length
    length: Length


class EllipsoidShape(_Shape):
    """Half axes in m, about its middle; a ball has three that are equal."""

    kind: Literal["ellipsoid"]
    half: tuple[Length, Length, Length]


class CapsuleShape(_Shape):
    """About its z axis and its middle, in m; `length`: of the cylinder between the two half balls."""

    kind: Literal["capsule"]
    radius: Length
    length: Length


class MeshShape(_Shape):
    """One of the scene's meshes, by its digest."""

    kind: Literal["mesh"]
    mesh: Digest


Shape = Annotated[BoxShape | CylinderShape | EllipsoidShape | CapsuleShape | MeshShape, Field(discriminator="kind")]
Shapes = Annotated[tuple[Shape, ...], Field(max_length=MAX_SHAPES)]


class MeshData(FrozenModel):
    """Triangles, seen from both sides; all numbers but the first are differences, which pack well.

    Attributes:
        scale: m in a unit of the points.
        points: x, y, z of the first point, then for each other one how far it is from the one before.
        triangles: of each, its first corner less that of the one before (of the first: less 0), then the other two
            corners less the first. Corners are numbers of points, counted from 0; from outside, they go round to the
            left.
    """

    scale: Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)]
    points: Coordinates
    triangles: Corners

    @classmethod
    def encoded(cls, points: IntArray, corners: IntArray, scale: float) -> MeshData:
        """Of points (P, 3) in steps, and corners (T, 3) that are rows of them."""
        first = corners[:, 0]
        turned = np.column_stack((np.diff(first, prepend=0), corners[:, 1] - first, corners[:, 2] - first))
        away = np.diff(points, axis=0, prepend=0)
        return cls(scale=scale, points=tuple(away.ravel().tolist()), triangles=tuple(turned.ravel().tolist()))

    def decoded(self) -> tuple[IntArray, IntArray]:
        """The points in steps, and the corners."""
        points = np.cumsum(np.array(self.points, dtype=np.int64).reshape(-1, 3), axis=0)
        turned = np.array(self.triangles, dtype=np.int64).reshape(-1, 3)
        first = np.cumsum(turned[:, 0])
        return points, np.column_stack((first, turned[:, 1] + first, turned[:, 2] + first))

    @property
    def is_whole(self) -> bool:
        """Whether points and triangles are complete, and all of its points are there."""
        if len(self.points) % 3 or len(self.triangles) % 3:
            return False
        points, corners = self.decoded()
        return int(corners.min()) >= 0 and int(corners.max()) < len(points)
