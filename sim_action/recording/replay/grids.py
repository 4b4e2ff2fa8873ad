"""Heightfields as a page draws them: fewer samples, the edges kept."""

from __future__ import annotations

from typing import Final

import numpy as np

from sim_action.recording.replay.simplification import FloatArray, Triangles
from sim_action.world.parts import GridPart, SurfacePart, grid_surface

MOST_SAMPLES: Final = 48
"""Along a side: 4,418 triangles."""


def coarse_surface(grid: GridPart) -> Triangles:
    """The surface of at most so many samples, evenly spread; the outermost are those of the grid."""
    rows, columns = grid.heights.shape
    heights = _resampled(_resampled(grid.heights, min(rows, MOST_SAMPLES)).T, min(columns, MOST_SAMPLES)).T
    surface: SurfacePart = grid_surface(GridPart(grid.size_xy, np.ascontiguousarray(heights)))
    return Triangles(surface.points_xyz, surface.triangles)


def _resampled(heights: FloatArray, count: int) -> FloatArray:
    """So many rows, evenly spread, with straight lines between those that there are."""
    places = np.linspace(0, len(heights) - 1, count)
    below = np.minimum(places.astype(np.int64), len(heights) - 2)
    share = (places - below)[:, None]
    found: FloatArray = heights[below] * (1 - share) + heights[below + 1] * share
    return found
