"""Hulls of collision meshes, as `models.meshes` writes them, back at the size that the mesh had.

They are drawn in there by what PyBullet puts around every hull. MuJoCo puts nothing around them, so they are grown
again: half an extent becomes what it was. That has an inverse, as what is thin kept a share of its thickness.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from sim_action.meshes.hull_file import hull_points
from sim_action.state.trace import FloatArray

# In m, as models.references draws them in, and the share of its thickness that models.meshes.hulls leaves of a hull.
_DRAWN_IN: Final = 0.001
_LEAST_SHARE: Final = 0.1
# Below this share of its extent, a hull has no volume that Qhull could find.
_FLAT: Final = 1e-6


def read_hulls(path: Path) -> list[FloatArray]:
    """The points (P, 3) in m of each hull of a mesh that was written here. Raises OSError."""
    return [solid(grown(points)) for points in hull_points(path)]


def grown(points: FloatArray) -> FloatArray:
    """The points before they were drawn in."""
    lower, upper = points.min(axis=0), points.max(axis=0)
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    thin = half <= _DRAWN_IN * _LEAST_SHARE / (1 - _LEAST_SHARE)
    share = np.where(thin, _LEAST_SHARE, half / (half + _DRAWN_IN))
    larger: FloatArray = middle + (points - middle) / share
    return larger


def solid(points: FloatArray) -> FloatArray:
    """The points; of a hull without a volume, those of one that is as thick as PyBullet's margin makes it."""
    centred = points - points.mean(axis=0)
    squares, axes = np.linalg.eigh(centred.T @ centred)
    for square, axis in zip(squares, axes.T, strict=True):
        if square <= (_FLAT * max(np.abs(centred).max(), _DRAWN_IN)) ** 2:
            points = np.concatenate((points - _DRAWN_IN * axis, points + _DRAWN_IN * axis))
    return points
