"""The pinhole camera model: the rays of a picture in any frame, and the pixels that a sphere may cover."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Vector3
from sim_action.core.records import dataclass

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
