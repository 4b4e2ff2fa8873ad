"""Geoms of MuJoCo: hulls as large as their meshes, surfaces as thin pieces, and messages with names of the user."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.meshes import clean_mesh
from sim_action.robot.model.robot_model import ENGINE_MARGIN_M
from sim_action.world import Body, World
from sim_action.world.parts import HullPart
from sim_action.world.scene import Scene
from tests.mesh_files import CORNERS, obj, stl, two_objects
from tests.traces import scene

geoms = pytest.importorskip("sim_action.engines.mujoco.geoms", reason="mujoco is not installed")


def clean(folder: Path, name: str, data: bytes) -> bytes:
    path = folder / name
    path.write_bytes(data)
    return clean_mesh(path, folder / "clean", margin=ENGINE_MARGIN_M).text


def test_meshes_are_hulls_as_large_as_they_were(tmp_path: Path) -> None:
    (points,) = geoms.read_unshrunk_hulls(clean(tmp_path, "box.stl", stl()))
    corners = np.array(CORNERS)
    apart = np.linalg.norm(points[:, np.newaxis] - corners, axis=2)
    assert len(points) == 8
    assert apart.min(axis=0).max() < 1e-7
    # Each part is a hull of its own.
    left, right = geoms.read_unshrunk_hulls(clean(tmp_path, "two.obj", two_objects()))
    assert left.mean(axis=0) == pytest.approx((0, 0, 0), abs=1e-8)
    assert right.mean(axis=0) == pytest.approx((1, 0, 0), abs=1e-8)
    # A scaled mesh is grown as it was drawn in.
    path = tmp_path / "box.obj"
    path.write_bytes(obj())
    scaled = clean_mesh(path, tmp_path / "clean", scale=(2, -1, 0.01), margin=ENGINE_MARGIN_M).text
    (points,) = geoms.read_unshrunk_hulls(scaled)
    assert np.ptp(points, axis=0) == pytest.approx((0.4, 0.4, 0.006), abs=1e-8)


@pytest.mark.parametrize(
    "points",
    [
        [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)],
        [(0, 0, 0), (1, 0, 1), (0, 1, 0), (1, 1, 1)],
        [(0, 0, 0), (1, 0, 0), (2, 0, 0)],
        [(3, 3, 3)],
    ],
)
def test_what_is_flat_gets_a_thickness(points: list[tuple[float, float, float]]) -> None:
    thick = geoms.thickened(np.array(points, dtype=np.float64))
    assert np.linalg.matrix_rank(thick - thick[0], tol=1e-6) == 3
    assert np.ptp(thick, axis=0) == pytest.approx(np.ptp(np.array(points), axis=0), abs=0.005)


def test_what_has_a_volume_is_left_alone() -> None:
    points = np.array(CORNERS)
    assert geoms.thickened(points) is points


ONE = np.array([[0, 1, 2]])


def test_a_piece_is_its_triangle_and_a_smaller_one_behind_it() -> None:
    corners = np.array([(0.0, 0, 0), (3, 0, 0), (0, 4, 0)])
    (piece,) = geoms.triangle_prisms(corners, ONE)
    assert (piece[:3] == corners).all()
    assert piece[3:, 2] == pytest.approx([-geoms.MAX_THICKNESS_M] * 3)
    # At 45 degrees, all sides have moved in by as much as it is thick; its inner circle has a radius of 1.
    assert piece[3, :2] == pytest.approx([geoms.MAX_THICKNESS_M] * 2)


@given(st.integers(0, 2**32 - 1), st.floats(1e-4, 10))
def test_a_piece_stays_behind_its_triangle_however_small(seed: int, size: float) -> None:
    corners = size * np.random.default_rng(seed).normal(size=(3, 3))
    (piece,) = geoms.triangle_prisms(corners, ONE)
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal /= np.linalg.norm(normal)
    above = (piece - corners[0]) @ normal
    assert above[:3] == pytest.approx([0] * 3, abs=1e-9 * size)
    assert (above[3:] < 0).all()
    assert (above[3:] >= -geoms.MAX_THICKNESS_M - 1e-12).all()
    # Seen from above, it is within the triangle.
    for start, end in ((0, 1), (1, 2), (2, 0)):
        inward = np.cross(normal, corners[end] - corners[start])
        assert ((piece - corners[start]) @ inward >= -1e-9 * size**2).all()


NAMES: Final = ("h", "h f/2", "hut")


def made() -> Scene:
    return replace(scene(), world=World(objects=tuple(Body(name=name, box=(1, 1, 1)) for name in NAMES)))


@pytest.mark.parametrize(
    ("said", "told"),
    [
        ("Error: volume of mesh object/h/0.3 is 0", "Error: volume of mesh 'h' is 0"),
        ("Error: bad\nElement name 'object/h f/2/0', id 4", "Error: bad Element name 'h f/2', id 4"),
        ("object/hut and 'object/h'", "'hut' and 'h'"),
        (
            "body 'robot/base_footprint', joint robot/wheel_left_joint",
            "body 'base_footprint', joint 'wheel_left_joint'",
        ),
        ("object/hall/0", "object/hall/0"),
        ("nothing of ours", "nothing of ours"),
    ],
)
def test_names_are_those_of_the_user(said: str, told: str) -> None:
    assert geoms.with_user_names(said, made()) == told


def test_so_is_what_it_says_of_a_hull_that_it_refuses() -> None:
    import mujoco

    spec = mujoco.MjSpec()
    flat = HullPart(((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 1.0, 0.0)))
    list(geoms.add_object(spec, Body(name="h", box=(1, 1, 1), mass=1.0), [flat]))
    with pytest.raises(ValueError, match="object/h") as refused:
        spec.compile()
    told = geoms.with_user_names(str(refused.value), made())
    assert "'h'" in told
    assert "object/" not in told
