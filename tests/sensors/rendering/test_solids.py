"""The geometry of a pinhole camera, and where rays enter solids: by hand, and against points inside or outside."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sim_action.core.geometry import Pose, Vector3, quaternion_from_rpy
from sim_action.meshes import clean_mesh
from sim_action.sensors.rendering import solids
from sim_action.sensors.rendering.solids import Patch, Pinhole, Rays
from tests.mesh_files import two_objects

BOX = solids.Polyhedron.box((1.0, 2.0, 3.0))
CORNERS = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-2.0, 2.0) for z in (-3.0, 3.0)])
CAN, PILL = solids.Cylinder(1.0, 2.0), solids.Capsule(1.0, 2.0)
EGG = solids.Ellipsoid((1.0, 2.0, 3.0))
SOLIDS: list[tuple[solids.Solid, Callable[[float, float, float], float]]] = [
    (BOX, lambda x, y, z: max(abs(x) - 1, abs(y) - 2, abs(z) - 3)),
    (solids.hull_polyhedron(CORNERS), lambda x, y, z: max(abs(x) - 1, abs(y) - 2, abs(z) - 3)),
    (CAN, lambda x, y, z: max(math.hypot(x, y) - 1, abs(z) - 2)),
    (PILL, lambda x, y, z: math.hypot(x, y, max(0.0, abs(z) - 2)) - 1),
    (EGG, lambda x, y, z: math.hypot(x, y / 2, z / 3) - 1),
]
ids = ("box", "hull", "can", "pill", "egg")
part = st.floats(-1, 1).map(lambda value: round(value, 3))
vector = st.tuples(part, part, part)


def entry(solid: solids.Solid, start: Vector3, way: Vector3) -> tuple[float, tuple[float, ...]]:
    """The depth at which a ray enters, and the normal there."""
    x, y, z = (np.full((1, 1), part) for part in way)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth, normals = solid.enter(Rays(start, (x, y, z)))
    return float(depth[0, 0]), tuple(float(part[0, 0]) for part in normals)


@pytest.mark.parametrize(
    ("solid", "start", "way", "depth", "normal"),
    [
        (BOX, (-5, 0.5, 0.5), (2, 0, 0), 2.0, (-1, 0, 0)),
        (BOX, (0, 5, 0), (0, -1, 0), 3.0, (0, 1, 0)),
        (BOX, (0, 5, 0), (1, 0, 0), math.inf, None),
        (CAN, (-5, 0, 1.9), (1, 0, 0), 4.0, (-1, 0, 0)),
        (CAN, (-5, 0, 2.1), (1, 0, 0), math.inf, None),
        (CAN, (0.5, 0.2, 5), (0, 0, -1), 3.0, (0, 0, 1)),
        (CAN, (2, 0, 5), (0, 0, -1), math.inf, None),
        (CAN, (-9, 0, 5), (1, 0, -1), math.inf, None),
        (CAN, (-3.5, 0, 5), (1, 0, -1), 3.0, (0, 0, 1)),
        (PILL, (-5, 0, 1), (1, 0, 0), 4.0, (-1, 0, 0)),
        (PILL, (0, 0, 9), (0, 0, -1), 6.0, (0, 0, 1)),
        (PILL, (0, 0, -9), (0, 0, 1), 6.0, (0, 0, -1)),
        (EGG, (0, -9, 0), (0, 1, 0), 7.0, (0, -1, 0)),
        (EGG, (0, -9, 3.1), (0, 1, 0), math.inf, None),
        (solids.Ellipsoid((2.0, 2.0, 2.0)), (-9, 0, 1), (1, 0, 0), 9 - math.sqrt(3), (-math.sqrt(3) / 2, 0, 0.5)),
    ],
)
def test_a_ray_enters_where_algebra_says(
    solid: solids.Solid, start: Vector3, way: Vector3, depth: float, normal: Vector3 | None
) -> None:
    found, faces = entry(solid, start, way)
    assert found == pytest.approx(depth, abs=1e-12)
    assert normal is None or faces == pytest.approx(normal, abs=1e-12)


@pytest.mark.parametrize(("solid", "outside"), SOLIDS, ids=ids)
@given(start=vector, aim=vector, spread=st.sampled_from((1, 1, 8)))
def test_before_it_enters_a_ray_is_outside_and_then_inside(
    solid: solids.Solid, outside: Callable[[float, float, float], float], start: Vector3, aim: Vector3, spread: int
) -> None:
    """Most rays aim at the solid: otherwise few of them would meet it."""
    (ax, ay, az), (bx, by, bz) = ((far * x, far * y, far * z) for far, (x, y, z) in ((8, start), (spread, aim)))
    way = (bx - ax, by - ay, bz - az)
    assume(math.hypot(*way) > 0.1)
    assume(outside(ax, ay, az) > 1e-3)

    def at(depth: float) -> float:
        return outside(ax + depth * way[0], ay + depth * way[1], az + depth * way[2])

    depth, normal = entry(solid, (ax, ay, az), way)
    on_the_way = [step / 500 for step in range(1, 1001)]
    if 0 <= depth < math.inf:
        assert at(depth) == pytest.approx(0, abs=1e-6)
        assert math.hypot(*normal) == pytest.approx(1)
        assert sum(one * other for one, other in zip(normal, way, strict=True)) < 1e-6
    assert [step for step in on_the_way if at(step) < -1e-6 and not 0 <= depth <= step] == []
    assert [step for step in on_the_way if step < depth and at(step) < -1e-6] == []


@pytest.mark.parametrize(("solid", "outside"), SOLIDS, ids=ids)
def test_from_inside_nothing_is_entered_ahead_and_its_radius_holds_it(
    solid: solids.Solid, outside: Callable[[float, float, float], float]
) -> None:
    for way in ((1, 0, 0), (0, -1, 0), (0, 0, 1), (1, 1, 1)):
        depth, _ = entry(solid, (0.1, 0.2, 0.3), way)
        assert depth < 0
    beyond = solid.radius * 1.001
    turns = [(math.cos(a) * math.sin(b), math.sin(a) * math.sin(b), math.cos(b)) for a in range(9) for b in range(9)]
    assert all(outside(beyond * x, beyond * y, beyond * z) > 0 for x, y, z in turns)


CUBE = np.array([(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
coordinate = st.floats(-1, 1).map(lambda value: round(value, 2))
points = st.lists(st.tuples(coordinate, coordinate, coordinate), min_size=1, max_size=30)


def heights(hull: solids.Polyhedron, of: np.ndarray) -> np.ndarray:
    """How far each point is above each plane: (N, P)."""
    above: np.ndarray = of @ hull.normals.T - hull.offsets
    return above


@given(points)
def test_a_hull_holds_its_points_and_touches_each_plane(given_points: list[tuple[float, float, float]]) -> None:
    cloud = np.array(given_points)
    hull = solids.hull_polyhedron(cloud)
    above = heights(hull, cloud)
    assert above.max() <= 1e-12
    assert np.abs(above.max(axis=0)).max() <= 1e-12
    assert np.sqrt((cloud**2).sum(axis=1)).max() <= hull.radius


def test_a_tilted_cube_has_no_room_to_spare() -> None:
    turn, _ = np.linalg.qr(np.array([(1.0, 2, 3), (4, 5, 7), (7, 8, 8)]))
    hull = solids.hull_polyhedron(CUBE @ turn)
    faces = np.concatenate((turn, -turn))
    assert all((np.abs(hull.normals - face).max(axis=1) < 1e-6).any() for face in faces)


def test_of_many_points_it_is_near_the_ball_they_lie_on() -> None:
    directions = np.random.default_rng(1).normal(size=(2000, 3))
    ball = directions / np.linalg.norm(directions, axis=1)[:, None]
    hull = solids.hull_polyhedron(ball)
    seen = [entry(hull, tuple(3 * point), tuple(-point))[0] for point in ball[:200]]
    assert min(seen) > 1.95
    assert max(seen) <= 2 + 1e-9
    assert len(hull.normals) < 250


@pytest.mark.parametrize("flat", [CUBE[:1], CUBE[:2], CUBE[:4]])
def test_what_has_no_volume_is_still_seen(flat: np.ndarray) -> None:
    depth, normal = entry(solids.hull_polyhedron(flat, 0.001), (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    assert depth == pytest.approx(0.999)
    assert normal == (-1, 0, 0)


def test_a_mesh_that_was_written_here_is_as_large_as_it_was(tmp_path: Path) -> None:
    (tmp_path / "two.obj").write_bytes(two_objects())
    clean = clean_mesh(tmp_path / "two.obj", tmp_path / "cache", margin=0.001)
    hulls = list(solids.read_hull_polyhedra(clean.text))
    assert [middle for _, middle in hulls] == [(0, 0, 0), (1, 0, 0)]
    for hull, _ in hulls:
        assert entry(hull, (-1, 0, 0), (1, 0, 0))[0] == pytest.approx(0.9)
        assert entry(hull, (0, 0, 1), (0, 0, -1))[0] == pytest.approx(0.7)


WIDE = Pinhole(width=40, height=20, field_of_view=math.radians(90), near=0.1, far=10.0)
ALL: Patch = (slice(None), slice(None))


def test_the_field_of_view_is_from_edge_to_edge() -> None:
    assert WIDE.focal_length == pytest.approx(20)
    assert WIDE.left[0, [0, 19, 20, 39]] == pytest.approx([0.975, 0.025, -0.025, -0.975])
    assert WIDE.up[[0, 9, 10, 19], 0] == pytest.approx([0.475, 0.025, -0.025, -0.475])


def test_rays_are_turned_with_the_camera() -> None:
    rays = WIDE.rays(Pose((1, 2, 3), quaternion_from_rpy(0, 0, math.pi / 2)), ALL)
    x, y, z = (np.broadcast_to(way, (20, 40)) for way in rays.ways)
    assert rays.start_xyz == (1, 2, 3)
    assert y == pytest.approx(np.ones((20, 40)))
    assert (x[0, 0], z[0, 0]) == pytest.approx((-0.975, 0.475))
    assert [part[0, 0] for part in rays.points(np.full((20, 40), 2.0))] == pytest.approx([1 - 1.95, 4, 3.95])


near_or_far = st.floats(-12, 12)
# What is at most as far to a side as it is ahead is in sight.
ahead = st.tuples(st.floats(0.1, 10), st.floats(-1, 1), st.floats(-0.5, 0.5))


@given(
    middle=st.tuples(st.floats(-1, 12), near_or_far, near_or_far)
    | ahead.map(lambda at: (at[0], at[0] * at[1], at[0] * at[2])),
    radius=st.floats(0.01, 3),
    toward=st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1)),
)
def test_a_patch_holds_all_of_a_ball(
    middle: tuple[float, float, float], radius: float, toward: tuple[float, float, float]
) -> None:
    share = radius / max(1.0, math.hypot(*toward))
    x, y, z = (at + share * part for at, part in zip(middle, toward, strict=True))
    if not WIDE.near <= x <= WIDE.far:
        return
    column, row = (math.floor(middle - WIDE.focal_length * part / x) for middle, part in ((20, y), (10, z)))
    if not (0 <= column < 40 and 0 <= row < 20):
        return
    patch = WIDE.patch_around(middle, radius)
    assert patch is not None
    rows, columns = patch
    assert rows.start <= row < rows.stop
    assert columns.start <= column < columns.stop


@pytest.mark.parametrize(
    "middle",
    [(-1.0, 0, 0), (11.0, 0, 0), (5.0, 9.0, 0), (5.0, 0, -9.0), (math.nan,) * 3, (math.inf,) * 3, (5.0, math.inf, 0)],
)
def test_what_is_behind_too_far_or_beside_has_none_and_a_ball_far_away_a_small_one(
    middle: tuple[float, float, float],
) -> None:
    assert WIDE.patch_around(middle, 0.5) is None
    assert WIDE.patch_around((5.0, 0, 0), 0.5) == (slice(7, 13), slice(17, 23))
