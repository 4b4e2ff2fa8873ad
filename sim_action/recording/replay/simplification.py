"""Surfaces of many triangles made into ones of few, by putting together what lies in the same cell of a grid.

Rossignac and Borrel (1993), "Multi-resolution 3D approximations for rendering complex scenes": it takes any triangles,
open or crossing each other, and costs next to nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_action.core.geometry import Vector3

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Cells along the longest side of what has few triangles, and of what has many of them.
_COARSEST: Final = 2
_FINEST: Final = 512
_TRIES: Final = 6


@dataclass(frozen=True, eq=False)
class Triangles:
    """A surface; `points_xyz`: (P, 3) m, `corners`: (T, 3) rows of these."""

    points_xyz: FloatArray
    corners: IntArray

    def __len__(self) -> int:
        return len(self.corners)

    def scaled(self, factors: Vector3) -> Triangles:
        """Larger by a factor along each axis; an odd number of them below 0 mirrors it, and its outside stays."""
        mirrors = math.prod(factors) < 0
        corners = self.corners[:, ::-1] if mirrors else self.corners
        return Triangles(self.points_xyz * np.array(factors), corners)


def simplified(surface: Triangles, most: int) -> Triangles:
    """A surface of at most so many triangles, as near to the other as a grid has it."""
    if len(surface) <= most:
        return surface
    low, high, found = _COARSEST, _FINEST, None
    # A surface crosses as many cells as its area has, so triangles grow with the square of the cells along a side.
    cells = int(math.sqrt(most / 6))
    for _ in range(_TRIES):
        cells = max(low, min(high, cells))
        tried = _clustered(surface, cells)
        if len(tried) <= most:
            found, low = tried, cells + 1
        else:
            high = cells - 1
        if low > high or (found is tried and len(tried) > 0.8 * most):
            break
        cells = max(low, min(high, int(cells * math.sqrt(most / max(1, len(tried))))))
    return found or _first(_clustered(surface, _COARSEST), most)


def _clustered(surface: Triangles, cells: int) -> Triangles:
    """With one point for all that lie in a cell; `cells`: along the longest side of the box around it."""
    points = surface.points_xyz
    lower = points.min(axis=0)
    size = float(np.ptp(points, axis=0).max()) / cells or 1.0
    places = np.minimum(((points - lower) / size).astype(np.int64), cells)
    keys = (places[:, 0] * (cells + 1) + places[:, 1]) * (cells + 1) + places[:, 2]
    _, names, counts = np.unique(keys, return_inverse=True, return_counts=True)
    names = names.ravel()
    sums = [np.bincount(names, weights=points[:, axis]) for axis in range(3)]
    return without_idle(Triangles(np.column_stack(sums) / counts[:, None], names[surface.corners]))


def without_idle(surface: Triangles) -> Triangles:
    """Without triangles that are lines, or there twice, and without points that no triangle has."""
    a, b, c = surface.corners.T
    kept = surface.corners[(a != b) & (b != c) & (a != c)]
    # Turned so that the first corner is the least: which side is out stays.
    turns = kept.argmin(axis=1)[:, None]
    kept = np.take_along_axis(kept, (turns + np.arange(3)) % 3, axis=1)
    kept = np.unique(kept, axis=0)
    used, corners = np.unique(kept, return_inverse=True)
    return Triangles(surface.points_xyz[used], corners.reshape(-1, 3).astype(np.int64))


def _first(surface: Triangles, most: int) -> Triangles:
    return without_idle(Triangles(surface.points_xyz, surface.corners[:most]))
