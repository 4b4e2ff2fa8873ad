"""Surfaces with many triangles become simpler."""

from __future__ import annotations

import numpy as np

from sim_action.world.parts import GridPart, SurfacePart, grid_surface
from sim_action.world.world_files.world_shapes import MAX_TRIANGLES, simplified


def bumpy(samples: int, size: float) -> SurfacePart:
    along = np.linspace(0.0, 3.0, samples)
    return grid_surface(GridPart((size, size), 0.02 * size * np.outer(np.sin(along), np.cos(along))))


def test_a_surface_of_few_triangles_stays() -> None:
    surface = bumpy(10, 1.0)

    assert simplified(surface) == (surface, 0.0)


def test_a_surface_of_many_triangles_keeps_its_place() -> None:
    surface = bumpy(120, 0.4)

    found = simplified(surface)

    assert found is not None
    simple, way = found
    assert 100 < len(simple.triangles) <= MAX_TRIANGLES
    assert 0 < way < 0.02 * 3**0.5
    for corner in (np.min, np.max):
        assert np.abs(corner(simple.points_xyz, axis=0) - corner(surface.points_xyz, axis=0)).max() <= way


def test_a_surface_that_is_too_large_for_small_cells_is_left() -> None:
    assert simplified(bumpy(120, 40.0)) is None
