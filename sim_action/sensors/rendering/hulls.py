"""Hulls of collision meshes, as `models.meshes` writes them, as solids."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from sim_action.core.geometry import Vector3
from sim_action.meshes.convex_hull import along, face_normals, furthest, spread_directions
from sim_action.meshes.hull_file import hull_points
from sim_action.sensors.rendering.rays import FloatArray
from sim_action.sensors.rendering.solids import Polyhedron

# In m: as much was taken off every hull when it was written (models.references), for engines to put around it.
_MARGIN: Final = 0.001
# Of a hull, those that reach furthest in as many directions: a ball of them is 4 % of its radius off at the most.
_MOST_POINTS: Final = 64


def read_hulls(path: Path) -> Iterator[tuple[Polyhedron, Vector3]]:
    """The hulls of a mesh that was written here, each about its middle, and where that is. Raises OSError."""
    return (hull_about_its_middle(points, _MARGIN) for points in hull_points(path))


def hull_about_its_middle(points: FloatArray, margin: float = 0.0) -> tuple[Polyhedron, Vector3]:
    """The hull of points (N, 3), and where its middle is: no ball around that is larger than need be."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    x, y, z = middle.tolist()
    return hull_of(points - middle, margin), (x, y, z)


def hull_of(points: FloatArray, margin: float = 0.0) -> Polyhedron:
    """The hull of points (N, 3), with a margin around it; it holds all of them, however flat they lie.

    Of the planes only the directions are those of faces that were found: where a plane is, all of the points say.
    """
    middle = points.mean(axis=0)
    normals = np.concatenate((np.eye(3), -np.eye(3), face_normals(outermost(points - middle))))
    _, first = np.unique(normals.round(6), axis=0, return_index=True)
    normals = normals[np.sort(first)]
    offsets = np.array([along(points, normal).max() for normal in normals]) + margin
    reach = float(np.sqrt((points**2).sum(axis=1)).max()) + 2 * margin
    return Polyhedron(normals, offsets, reach)


def outermost(points: FloatArray, most: int = _MOST_POINTS) -> FloatArray:
    """Of points (N, 3) about their middle, those that reach furthest; all of them, if they are few."""
    if len(points) <= most:
        return points
    return furthest(points, spread_directions(most))
