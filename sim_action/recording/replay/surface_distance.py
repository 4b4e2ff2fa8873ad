"""The distance of points from the shapes of a body, to find the body that a ray of a sensor met."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.recording.replay.columns import FloatArray
from sim_action.recording.replay.surfaces import Triangles, hull_surface
from sim_action.world.parts import BoxPart, CylinderPart, GridPart, HullPart, Part, SpherePart, grid_surface

# The largest number of pairs of a point and a triangle at once; an array of them has 24 MB.
_MAX_PAIRS: Final = 1_000_000


def distance_to(parts: Sequence[Part], points_xyz: FloatArray) -> FloatArray:
    """Return the distances (N,) in m of points (N, 3), in the frame of the body; at most 0 inside a solid."""
    nearest = np.full(len(points_xyz), math.inf)
    hulls = [np.array(part.points_xyz) for part in parts if isinstance(part, HullPart)]
    surfaces = [hull_surface(hulls)] if hulls else []
    for part in parts:
        if isinstance(part, BoxPart | CylinderPart | SpherePart):
            nearest = np.minimum(nearest, _from_solid(part, points_xyz))
        elif not isinstance(part, HullPart):
            found = grid_surface(part) if isinstance(part, GridPart) else part
            surfaces.append(Triangles(found.points_xyz, found.triangles))
    for surface in surfaces:
        if surface is not None:
            nearest = np.minimum(nearest, _from_surface(surface, points_xyz))
    return nearest


def _from_solid(part: BoxPart | CylinderPart | SpherePart, points_xyz: FloatArray) -> FloatArray:
    if isinstance(part, SpherePart):
        away: FloatArray = np.linalg.norm(points_xyz - part.pose.position_xyz, axis=1)
        return away - part.radius
    x, y, z = seen_from(part.pose, points_xyz).T
    if isinstance(part, CylinderPart):
        over = np.stack((np.hypot(x, y) - part.radius, np.abs(z) - part.height / 2))
    else:
        over = np.stack([np.abs(along) - size / 2 for along, size in zip((x, y, z), part.size_xyz, strict=True)])
    outside: FloatArray = np.sqrt(np.square(np.maximum(over, 0.0)).sum(axis=0))
    inside: FloatArray = np.minimum(over.max(axis=0), 0.0)
    return outside + inside


def seen_from(pose: Pose, points_xyz: FloatArray) -> FloatArray:
    """Return points (N, 3) of the parent frame in the frame of a pose."""
    axes = np.array([geometry.rotate(pose.orientation_xyzw, axis) for axis in geometry.AXES])
    turned: FloatArray = (points_xyz - pose.position_xyz) @ axes.T
    return turned


def _from_surface(surface: Triangles, points_xyz: FloatArray) -> FloatArray:
    """Return the distances from the nearest triangle."""
    triangles = surface.points_xyz[surface.corners]
    most = max(1, _MAX_PAIRS // max(1, len(triangles)))
    blocks = [_from_triangles(triangles, points_xyz[i : i + most]) for i in range(0, len(points_xyz), most)]
    return np.concatenate(blocks) if blocks else np.empty(0)


def _from_triangles(triangles: FloatArray, points_xyz: FloatArray) -> FloatArray:
    """Return the distances (N,) of points (N, 3) from triangles (T, 3, 3): those of a face or of an edge."""
    a, b, c = (triangles[:, corner] for corner in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    normal = normal / np.maximum(length, 1e-30)[:, None]
    away = points_xyz[:, None] - a
    over = np.einsum("ntx,tx->nt", away, normal)
    is_above = np.broadcast_to(length > 0, over.shape)
    squared = np.full(over.shape, math.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        edge, there = end - start, points_xyz[:, None] - start
        along = np.einsum("ntx,tx->nt", there, edge) / np.maximum(np.square(edge).sum(axis=1), 1e-30)
        off = there - np.clip(along, 0.0, 1.0)[:, :, None] * edge
        squared = np.minimum(squared, np.square(off).sum(axis=2))
        is_above = is_above & (np.einsum("ntx,tx->nt", there, np.cross(normal, edge)) >= 0)
    nearest: FloatArray = np.where(is_above, np.abs(over), np.sqrt(squared)).min(axis=1, initial=math.inf)
    return nearest
