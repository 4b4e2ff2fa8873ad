"""The shapes of links and bodies in a replay: solids, and meshes that several shapes may share."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import Annotated, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from sim_action.core.field_types import FrozenModel

IntArray = NDArray[np.int64]

MAX_SHAPES: Final = 5_000
"""The largest number of shapes of a link or body; a map has at most 2,000 walls."""

MAX_POINTS: Final = 40_000
"""The largest number of points of a mesh."""

MAX_ABS_VALUE: Final = 1e9
"""The largest absolute value of any number in its unit."""

Number = Annotated[float, Field(ge=-MAX_ABS_VALUE, le=MAX_ABS_VALUE, allow_inf_nan=False)]
Length = Annotated[float, Field(ge=0, le=MAX_ABS_VALUE, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1)]

Colour = tuple[Share, Share, Share]
"""Red, green and blue."""

Place = tuple[Number, Number, Number]
"""A position x, y, z in m."""

PoseNumbers = tuple[Number, Number, Number, Number, Number, Number, Number]
"""A pose: x, y, z in m and quaternion x, y, z, w."""


def numbers(values: Iterable[float]) -> tuple[float, ...]:
    """Round numbers to 1e-5 (m or quaternion components): this is enough for display and compresses better."""
    return tuple(round(value, 5) for value in values)


Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{16,64}$")]
Coordinates = Annotated[
    tuple[Annotated[int, Field(ge=-(2**31), le=2**31)], ...], Field(min_length=9, max_length=3 * MAX_POINTS)
]
Corners = Annotated[
    tuple[Annotated[int, Field(gt=-MAX_POINTS, lt=MAX_POINTS)], ...], Field(min_length=3, max_length=6 * MAX_POINTS)
]


class _Shape(FrozenModel):
    """A shape in the frame of its link or body; `color` is red, green, blue from 0 to 1."""

    pose: PoseNumbers
    color: Colour
    opacity: Share = 1.0


class BoxShape(_Shape):
    """A box, centred; full sizes in m."""

    kind: Literal["box"]
    size: tuple[Length, Length, Length]


class CylinderShape(_Shape):
    """A cylinder along z, centred; in m."""

    kind: Literal["cylinder"]
    radius: Length
    length: Length


class EllipsoidShape(_Shape):
    """An ellipsoid, centred; half axes in m."""

    kind: Literal["ellipsoid"]
    half: tuple[Length, Length, Length]


class CapsuleShape(_Shape):
    """A capsule along z, centred; `length` is that of the cylinder between the hemispheres, in m."""

    kind: Literal["capsule"]
    radius: Length
    length: Length


class MeshShape(_Shape):
    """A mesh of the scene, by its digest."""

    kind: Literal["mesh"]
    mesh: Digest


Shape = Annotated[BoxShape | CylinderShape | EllipsoidShape | CapsuleShape | MeshShape, Field(discriminator="kind")]
Shapes = Annotated[tuple[Shape, ...], Field(max_length=MAX_SHAPES)]


class MeshData(FrozenModel):
    """A triangle mesh, visible from both sides; numbers are stored as differences, which compress well.

    Attributes:
        scale: the size in m of a step of `points`.
        points: x, y, z of the first point in steps, then the differences of each point from the one before.
        triangles: for each triangle the first corner minus that of the triangle before (minus 0 for the first one),
            then the other two corners minus the first. Corners are indices of points, counter-clockwise seen from
            outside.
    """

    scale: Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)]
    points: Coordinates
    triangles: Corners

    @classmethod
    def encoded(cls, points: IntArray, corners: IntArray, scale: float) -> MeshData:
        """Return the mesh of points (P, 3) in steps of `scale` m and corners (T, 3), indices of points."""
        first = corners[:, 0]
        turned = np.column_stack((np.diff(first, prepend=0), corners[:, 1] - first, corners[:, 2] - first))
        away = np.diff(points, axis=0, prepend=0)
        return cls(scale=scale, points=tuple(away.ravel().tolist()), triangles=tuple(turned.ravel().tolist()))

    def decoded(self) -> tuple[IntArray, IntArray]:
        """Return points (P, 3) in steps of `scale` m, and corners (T, 3)."""
        points = np.cumsum(np.array(self.points, dtype=np.int64).reshape(-1, 3), axis=0)
        turned = np.array(self.triangles, dtype=np.int64).reshape(-1, 3)
        first = np.cumsum(turned[:, 0])
        return points, np.column_stack((first, turned[:, 1] + first, turned[:, 2] + first))

    @cached_property
    def is_whole(self) -> bool:
        """True if points and triangles are complete and all corners exist."""
        if len(self.points) % 3 or len(self.triangles) % 3:
            return False
        points, corners = self.decoded()
        return int(corners.min()) >= 0 and int(corners.max()) < len(points)
