"""Meshes of a replay: within a budget of triangles, in whole steps of their size, each once."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from sim_action.recording.replay.shapes import MeshData
from sim_action.recording.replay.simplification import Triangles, simplified, without_idle

# Triangles that every mesh may have: those of a box.
_LEAST: Final = 12
# Steps along the longest side of a mesh: half a millimetre of a metre.
_STEPS: Final = 2**10
# In m: finer steps than these are no use to anybody.
_FINEST: Final = 1e-5


@dataclass(frozen=True, slots=True)
class Budget:
    """How many triangles there may be; `each`: of one mesh."""

    each: int
    all: int


ROBOT: Final = Budget(1_200, 8_000)
WORLD: Final = Budget(4_500, 8_000)


def within(budget: Budget, surfaces: Sequence[Triangles]) -> list[Triangles]:
    """The surfaces within a budget: those of few triangles keep them, and the others have what is left to share."""
    counts = sorted(min(len(surface), budget.each) for surface in surfaces)
    each, left = budget.each, budget.all
    for place, count in enumerate(counts):
        share = left // (len(counts) - place)
        if count > share:
            each = max(_LEAST, share)
            break
        left -= count
    return [simplified(surface, each) for surface in surfaces]


def mesh_data(surface: Triangles) -> MeshData | None:
    """A surface as it is stored; None if nothing is left of it."""
    points = surface.points_xyz
    if not len(surface) or not np.isfinite(points).all():
        return None
    step = max(_FINEST, float(np.ptp(points, axis=0).max()) / _STEPS)
    places = np.rint(points / step).astype(np.int64)
    grid, names = np.unique(places, axis=0, return_inverse=True)
    whole = without_idle(Triangles(grid.astype(np.float64), names.ravel()[surface.corners]))
    if not len(whole):
        return None
    return MeshData.encoded(whole.points_xyz.astype(np.int64), whole.corners, float(f"{step:.6g}"))


def digest_of(mesh: MeshData) -> str:
    """What is the same for meshes that are alike."""
    return hashlib.sha256(repr((mesh.scale, mesh.points, mesh.triangles)).encode()).hexdigest()[:16]
