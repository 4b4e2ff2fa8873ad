"""Convex hulls as surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from sim_action.meshes.convex_hull import hull_faces
from sim_action.recording.replay.simplification import FloatArray, IntArray, Triangles
from sim_action.sensors.rendering.hulls import outermost

# Points of all hulls of a shape, and the least and the most of each: to find the faces takes 0.1 ms a point.
_ALL: Final = 512
_LEAST: Final = 12
_MOST: Final = 64


def hull_surface(hulls: Sequence[FloatArray]) -> Triangles | None:
    """The surface of several hulls, each of points (P, 3); None if none of them has a volume."""
    most = min(_MOST, max(_LEAST, _ALL // max(1, len(hulls))))
    found = [surface for surface in (_surface(points, most) for points in hulls) if surface is not None]
    if not found:
        return None
    above = np.cumsum([0, *(len(surface.points_xyz) for surface in found)])
    corners = [surface.corners + before for surface, before in zip(found, above[:-1], strict=True)]
    return Triangles(np.concatenate([surface.points_xyz for surface in found]), np.concatenate(corners))


def _surface(points: FloatArray, most: int) -> Triangles | None:
    middle = points.mean(axis=0)
    kept = outermost(points - middle, most)
    faces = hull_faces(kept)
    return None if faces is None else Triangles(kept + middle, _outwards(kept, faces.astype(np.int64)))


def _outwards(points: FloatArray, faces: IntArray) -> IntArray:
    """Faces of a hull, with their corners the way round that shows which side is out."""
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    inwards = ((a - points.mean(axis=0)) * np.cross(b - a, c - a)).sum(axis=1) < 0
    turned = faces.copy()
    turned[inwards] = faces[inwards][:, ::-1]
    return turned
