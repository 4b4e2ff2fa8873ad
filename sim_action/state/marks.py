"""Where in the world an assertion is about something: what reports draw into it. All in m, world frame."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, TypeAlias

# How far a bound that goes on for ever is drawn, either way.
_FAR: Final = 5.0


@dataclass(frozen=True, slots=True)
class Circle:
    """On the ground plane, or as high as `z`."""

    x: float
    y: float
    radius: float
    z: float = 0.0


@dataclass(frozen=True, slots=True)
class Polygon:
    """An area of the ground plane, as its corners."""

    points: tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class Polyline:
    """A way from point to point."""

    points: tuple[tuple[float, float, float], ...]


@dataclass(frozen=True, slots=True)
class Arrow:
    """A heading at a place on the ground plane: `yaw` in rad about the z axis."""

    x: float
    y: float
    yaw: float


Mark: TypeAlias = Circle | Polygon | Polyline | Arrow


def rectangle(x: tuple[float, float], y: tuple[float, float]) -> Polygon:
    """The area between two bounds each."""
    return Polygon(((x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])))


def line(axis: str, at: float, middle_xy: tuple[float, float]) -> Polyline:
    """All places of the ground plane with one x, or one y; drawn for some metres about `middle_xy`."""
    x, y = middle_xy
    if axis == "x":
        return Polyline(((at, y - _FAR, 0.0), (at, y + _FAR, 0.0)))
    return Polyline(((x - _FAR, at, 0.0), (x + _FAR, at, 0.0)))


def goal(x: float, y: float, z: float | None, tolerance: float, yaw: float | None) -> Iterator[Mark]:
    """A place to come to, and how to head there."""
    yield Circle(x, y, tolerance, z or 0.0)
    if yaw is not None and math.isfinite(yaw):
        yield Arrow(x, y, yaw)
