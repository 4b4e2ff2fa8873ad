"""Collision meshes as `models.meshes` writes them: a hull for each object of an OBJ, its points alone of interest."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sim_action.meshes.convex_hull import FloatArray


def hull_points(path: Path) -> list[FloatArray]:
    """The points (P, 3) in m of each hull of a file that was written here. Raises OSError."""
    hulls = list[list[list[float]]]()
    for line in path.read_text(encoding="ascii").splitlines():
        kind, *values = line.split()
        if kind == "o":
            hulls.append([])
        elif kind == "v":
            hulls[-1].append([float(value) for value in values])
    return [np.array(points) for points in hulls]
