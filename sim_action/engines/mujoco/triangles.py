"""Triangles of a surface as convex pieces, each as thin as a few millimetres, behind the triangle.

Which side is behind, the order of its corners tells: seen from outside they turn to the left. A piece tapers away from
its triangle, so that it looks out of no neighbour but at edges that are sharper than 45 degrees.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from sim_action.state.trace import FloatArray

THICKNESS: Final = 0.005
"""m, of a piece, where the triangle is large enough: as far as a body gets in a step that is as fast as 1.2 m/s."""


def behind(points_xyz: FloatArray, triangles: np.ndarray) -> Iterator[FloatArray]:
    """(6, 3) the corners of the piece behind each triangle: those of the triangle, and as many behind them."""
    corners = points_xyz[triangles]
    a, b, c = (corners[:, corner] for corner in range(3))
    normals = np.cross(b - a, c - a)
    doubled_area = np.linalg.norm(normals, axis=1)
    normals /= doubled_area[:, None]
    sides = np.stack([np.linalg.norm(q - p, axis=1) for p, q in ((b, c), (c, a), (a, b))], axis=1)
    around = sides.sum(axis=1)
    # The circle that fits in: it shrinks evenly as all sides move in.
    radii = doubled_area / around
    middles = (corners * sides[:, :, None]).sum(axis=1) / around[:, None]
    depths = np.minimum(THICKNESS, radii / 2)
    shrunk = middles[:, None] + (corners - middles[:, None]) * (1 - depths / radii)[:, None, None]
    return iter(np.concatenate((corners, shrunk - (depths[:, None] * normals)[:, None]), axis=1))
