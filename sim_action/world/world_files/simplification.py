"""Simplify surfaces with many triangles: points near each other become one."""

from __future__ import annotations

from typing import Final

import numpy as np

from sim_action.world.parts import SurfacePart

MAX_TRIANGLES: Final = 1_000
"""A mesh of a world with more triangles is simplified: each costs time at every step."""

_CELLS_M: Final = (0.001, 0.002, 0.005, 0.01, 0.02)


def simplified(surface: SurfacePart) -> tuple[SurfacePart, float] | None:
    """Return a surface with at most MAX_TRIANGLES, and the greatest way in m of a point; None if 2 cm are too few."""
    if len(surface.triangles) <= MAX_TRIANGLES:
        return surface, 0.0
    for size in _CELLS_M:
        cells, numbers = np.unique(np.floor(surface.points_xyz / size), axis=0, return_inverse=True)
        corners = numbers.reshape(-1)[surface.triangles]
        a, b, c = corners.T
        corners = corners[(a != b) & (b != c) & (c != a)]
        # The first corner is the least one, so that a triangle and its copy are equal.
        first = corners.argmin(axis=1)
        turned = np.stack([np.take_along_axis(corners, (first[:, None] + k) % 3, axis=1)[:, 0] for k in range(3)], 1)
        kept = np.unique(turned, axis=0)
        if 0 < len(kept) <= MAX_TRIANGLES:
            sums, counts = np.zeros((len(cells), 3)), np.zeros(len(cells))
            np.add.at(sums, numbers.reshape(-1), surface.points_xyz)
            np.add.at(counts, numbers.reshape(-1), 1.0)
            points = sums / counts[:, None]
            edges = points[kept]
            areas = np.linalg.norm(np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0]), axis=1)
            moved = float(np.linalg.norm(points[numbers.reshape(-1)] - surface.points_xyz, axis=1).max())
            return SurfacePart(points, kept[areas > 0]), moved
    return None
