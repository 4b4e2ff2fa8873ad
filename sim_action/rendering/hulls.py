"""Hulls of collision meshes, as `models.meshes` writes them, as solids."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_action.geometry import Vector3
from sim_action.rendering.rays import FloatArray
from sim_action.rendering.solids import Polyhedron

IntArray = NDArray[np.intp]

# In m: as much was taken off every hull when it was written (models.references), for engines to put around it.
_MARGIN: Final = 0.001
# Of a hull, those that reach furthest in as many directions: a ball of them is 4 % of its radius off at the most.
_MOST_POINTS: Final = 64
# Of its extent: what is nearer to a plane is on it.
_FLAT: Final = 1e-6


def read_hulls(path: Path) -> Iterator[tuple[Polyhedron, Vector3]]:
    """The hulls of a mesh that was written here, each about its middle, and where that is. Raises OSError."""
    hulls = list[list[list[float]]]()
    for line in path.read_text(encoding="ascii").splitlines():
        kind, *values = line.split()
        if kind == "o":
            hulls.append([])
        elif kind == "v":
            hulls[-1].append([float(value) for value in values])
    return (_about_its_middle(np.array(points)) for points in hulls)


def _about_its_middle(points: FloatArray) -> tuple[Polyhedron, Vector3]:
    """So that no ball around the origin is larger than need be."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    x, y, z = middle.tolist()
    return hull_of(points - middle, _MARGIN), (x, y, z)


def hull_of(points: FloatArray, margin: float = 0.0) -> Polyhedron:
    """The hull of points (N, 3), with a margin around it; it holds all of them, however flat they lie.

    Of the planes only the directions are those of faces that were found: where a plane is, all of the points say.
    """
    middle = points.mean(axis=0)
    normals = np.concatenate((np.eye(3), -np.eye(3), _face_normals(_outermost(points - middle))))
    _, first = np.unique(normals.round(6), axis=0, return_index=True)
    normals = normals[np.sort(first)]
    offsets = np.array([_along(points, normal).max() for normal in normals]) + margin
    reach = float(np.sqrt((points**2).sum(axis=1)).max()) + 2 * margin
    return Polyhedron(normals, offsets, reach)


def _outermost(points: FloatArray) -> FloatArray:
    if len(points) <= _MOST_POINTS:
        return points
    extents = np.ptp(points, axis=0)
    even = points / np.where(extents > 0, extents, 1.0)
    heights = 1 - (2 * np.arange(_MOST_POINTS) + 1) / _MOST_POINTS
    turns = np.pi * (3 - np.sqrt(5)) * np.arange(_MOST_POINTS)
    around = np.sqrt(1 - heights**2)
    directions = np.column_stack((around * np.cos(turns), around * np.sin(turns), heights))
    return points[sorted({int(_along(even, direction).argmax()) for direction in directions})]


def _face_normals(points: FloatArray) -> FloatArray:
    """(F, 3) unit vectors out of the faces of a hull, which grows point by point; none if it has no volume."""
    eps = _FLAT * float(np.abs(points).max())
    corners = _first_corners(points, eps)
    if corners is None:
        return np.empty((0, 3))
    inside = points[list(corners)].mean(axis=0)
    a, b, c, d = corners
    faces = np.array([(a, b, c), (a, b, d), (a, c, d), (b, c, d)])
    normals, offsets = _planes(points, faces, inside)
    for number, point in enumerate(points):
        seen = _along(normals, point) > offsets + eps
        if seen.any():
            rim = _rim(faces[seen])
            grown = np.column_stack((rim, np.full(len(rim), number)))
            new_normals, new_offsets = _planes(points, grown, inside)
            faces = np.concatenate((faces[~seen], grown))
            normals = np.concatenate((normals[~seen], new_normals))
            offsets = np.concatenate((offsets[~seen], new_offsets))
    return normals


def _rim(faces: IntArray) -> IntArray:
    """(E, 2) the edges that belong to one of the faces only."""
    edges = np.sort(faces[:, [(0, 1), (1, 2), (2, 0)]].reshape(-1, 2), axis=1)
    found, counts = np.unique(edges, axis=0, return_counts=True)
    rim: IntArray = found[counts == 1]
    return rim


def _planes(points: FloatArray, faces: IntArray, inside: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(F, 3) normals, away from a point inside, and (F,) offsets."""
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.sqrt((normals**2).sum(axis=1))
    normals /= np.where(lengths > 0, lengths, 1.0)[:, None]
    normals *= np.where(((a - inside) * normals).sum(axis=1) < 0, -1.0, 1.0)[:, None]
    return normals, (a * normals).sum(axis=1)


def _first_corners(points: FloatArray, eps: float) -> tuple[int, int, int, int] | None:
    """Four points that are far from lying in a plane."""
    a = int(points[:, 0].argmin())
    away = points - points[a]
    b = int((away**2).sum(axis=1).argmax())
    across = np.cross(away, away[b])
    c = int((across**2).sum(axis=1).argmax())
    heights = np.abs(_along(away, np.cross(away[b], away[c])))
    d = int(heights.argmax())
    area = float(np.sqrt((np.cross(away[b], away[c]) ** 2).sum()))
    return (a, b, c, d) if heights[d] > eps * area else None


def _along(points: FloatArray, direction: FloatArray) -> FloatArray:
    """Sums of products, not a product of matrices: the same on every machine."""
    length: FloatArray = points[..., 0] * direction[0] + points[..., 1] * direction[1] + points[..., 2] * direction[2]
    return length
