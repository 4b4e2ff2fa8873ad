"""Rays into solids, one at a time."""

from __future__ import annotations

import numpy as np

from sim_action.core.geometry import Vector3
from sim_action.sensors.rendering.pinhole import Rays
from sim_action.sensors.rendering.solids import Solid


def entry(solid: Solid, start: Vector3, way: Vector3) -> tuple[float, tuple[float, ...]]:
    """The depth at which a ray enters, and the normal there."""
    x, y, z = (np.full((1, 1), part) for part in way)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth, normals = solid.enter(Rays(start, (x, y, z)))
    return float(depth[0, 0]), tuple(float(part[0, 0]) for part in normals)
