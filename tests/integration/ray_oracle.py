"""Where rays meet the bodies of a world, by the equations of their shapes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_action.core import geometry
from sim_action.world import Body

Floats = NDArray[np.float64]


def first_hits(bodies: Sequence[Body], start: geometry.Vector3, ends: Floats, *, grown: float = 0.0) -> Floats:
    """(N,) shares of the ways at which rays first enter a body or the ground; inf: never.

    `grown`: m by which every surface is further out than it is.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        hits = [_ground(start, ends, grown), *(_entry(body, start, ends, grown) for body in bodies)]
    first: Floats = np.min(hits, axis=0)
    return first


def _ground(start: geometry.Vector3, ends: Floats, grown: float) -> Floats:
    share = (start[2] - grown) / (start[2] - ends[:, 2])
    return np.where((share >= 0) & (share <= 1), share, np.inf)


def _entry(body: Body, start: geometry.Vector3, ends: Floats, grown: float) -> Floats:
    """All bodies are intersections of what a ray is in from one share of its way to another."""
    place = body.pose
    back = geometry.conjugate(place.orientation_xyzw)
    origin = np.array([place.x, place.y, place.z or 0.0])
    begin = np.array(geometry.rotate(back, tuple(np.array(start) - origin)))
    way = _rotated(back, ends - start)
    inside = _inside(body, begin, way, grown)
    enter, leave = np.max([first for first, _ in inside], axis=0), np.min([last for _, last in inside], axis=0)
    return np.where((enter <= leave) & (enter >= 0) & (enter <= 1), enter, np.inf)


def _rotated(rotation: geometry.Quaternion, rows: Floats) -> Floats:
    columns: Any = tuple(rows.T)
    return np.column_stack(geometry.rotate(rotation, columns))


def _inside(body: Body, begin: Floats, way: Floats, grown: float) -> list[tuple[Floats, Floats]]:
    if body.box is not None:
        return [_between(begin[axis], way[:, axis], body.box[axis] / 2 + grown) for axis in range(3)]
    if body.sphere is not None:
        return [_around(begin, way, body.sphere.radius + grown)]
    assert body.cylinder is not None
    flat = _between(begin[2], way[:, 2], body.cylinder.height / 2 + grown)
    return [flat, _around(begin[:2], way[:, :2], body.cylinder.radius + grown)]


def _between(begin: float, way: Floats, half: float) -> tuple[Floats, Floats]:
    first, second = (-half - begin) / way, (half - begin) / way
    return np.minimum(first, second), np.maximum(first, second)


def _around(begin: Floats, way: Floats, radius: float) -> tuple[Floats, Floats]:
    along, length, out = way @ begin, (way**2).sum(axis=1), begin @ begin - radius**2
    root = np.sqrt(along**2 - length * out)
    enter, leave = (-along - root) / length, (-along + root) / length
    return np.where(np.isnan(root), np.inf, enter), np.where(np.isnan(root), -np.inf, leave)
