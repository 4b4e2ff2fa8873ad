"""Points become the planes around them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.meshes import clean_mesh
from sim_action.sensors.rendering.hulls import hull_of, read_hulls
from sim_action.sensors.rendering.solids import Polyhedron
from tests.mesh_files import two_objects
from tests.sensors.rendering.solid_rays import entry

CUBE = np.array([(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
coordinate = st.floats(-1, 1).map(lambda value: round(value, 2))
points = st.lists(st.tuples(coordinate, coordinate, coordinate), min_size=1, max_size=30)


def heights(hull: Polyhedron, of: np.ndarray) -> np.ndarray:
    """How far each point is above each plane: (N, P)."""
    above: np.ndarray = of @ hull.normals.T - hull.offsets
    return above


@given(points)
def test_a_hull_holds_its_points_and_touches_each_plane(given_points: list[tuple[float, float, float]]) -> None:
    cloud = np.array(given_points)
    hull = hull_of(cloud)
    above = heights(hull, cloud)
    assert above.max() <= 1e-12
    assert np.abs(above.max(axis=0)).max() <= 1e-12
    assert np.sqrt((cloud**2).sum(axis=1)).max() <= hull.radius


def test_a_tilted_cube_has_no_room_to_spare() -> None:
    turn, _ = np.linalg.qr(np.array([(1.0, 2, 3), (4, 5, 7), (7, 8, 8)]))
    hull = hull_of(CUBE @ turn)
    faces = np.concatenate((turn, -turn))
    assert all((np.abs(hull.normals - face).max(axis=1) < 1e-6).any() for face in faces)


def test_of_many_points_it_is_near_the_ball_they_lie_on() -> None:
    directions = np.random.default_rng(1).normal(size=(2000, 3))
    ball = directions / np.linalg.norm(directions, axis=1)[:, None]
    hull = hull_of(ball)
    seen = [entry(hull, tuple(3 * point), tuple(-point))[0] for point in ball[:200]]
    assert min(seen) > 1.95
    assert max(seen) <= 2 + 1e-9
    assert len(hull.normals) < 250


@pytest.mark.parametrize("flat", [CUBE[:1], CUBE[:2], CUBE[:4]])
def test_what_has_no_volume_is_still_seen(flat: np.ndarray) -> None:
    depth, normal = entry(hull_of(flat, 0.001), (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    assert depth == pytest.approx(0.999)
    assert normal == (-1, 0, 0)


def test_a_mesh_that_was_written_here_is_as_large_as_it_was(tmp_path: Path) -> None:
    (tmp_path / "two.obj").write_bytes(two_objects())
    clean = clean_mesh(tmp_path / "two.obj", tmp_path / "cache", margin=0.001)
    hulls = list(read_hulls(clean.path))
    assert [middle for _, middle in hulls] == [(0, 0, 0), (1, 0, 0)]
    for hull, _ in hulls:
        assert entry(hull, (-1, 0, 0), (1, 0, 0))[0] == pytest.approx(0.9)
        assert entry(hull, (0, 0, 1), (0, 0, -1))[0] == pytest.approx(0.7)
