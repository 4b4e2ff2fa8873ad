"""Faces of hulls, and what hulls weigh."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.lazy_numpy import FloatArray
from sim_action.meshes import convex_hull
from sim_action.meshes.collision_hulls import shrunk, unshrunk
from sim_action.meshes.convex_hull import along, face_normals, furthest, hull_faces, mass_properties, spread_directions
from tests.soak import examples

BOX = np.array([(x, y, z) for x in (0.0, 2.0) for y in (0.0, 1.0) for z in (0.0, 0.5)])


MORE = np.array([(0.0, y, z) for y in (0.25, 0.5) for z in (0.125, 0.25, 0.375)])


@pytest.mark.parametrize("points", [BOX, np.concatenate((BOX, MORE))], ids=["corners", "more points on one side"])
def test_a_box_weighs_as_in_the_books(points: FloatArray) -> None:
    found = mass_properties(points + 10)
    assert found.centre_xyz == pytest.approx([11, 10.5, 10.25])
    expected = np.diag([1 + 0.25, 4 + 0.25, 4 + 1]) / 12
    assert found.inertia == pytest.approx(expected, abs=1e-9)


def test_a_tetrahedron_weighs_where_its_corners_have_their_mean() -> None:
    corners = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    found = mass_properties(corners)
    assert found.centre_xyz == pytest.approx([0.25] * 3)
    # Of x^2 over it, the mean is 1/10.
    assert np.diag(found.inertia) == pytest.approx([2 * (1 / 10 - 1 / 16)] * 3)


@given(st.integers(0, 2**32 - 1))
def test_no_point_is_before_a_face(seed: int) -> None:
    points = np.random.default_rng(seed).normal(size=(30, 3))
    points -= points.mean(axis=0)
    faces, normals = hull_faces(points), face_normals(points)
    assert faces is not None
    offsets = (points[faces[:, 0]] * normals).sum(axis=1)
    assert (points @ normals.T <= offsets + 1e-5).all()


def test_what_is_flat_has_no_faces() -> None:
    assert hull_faces(np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]) - [0.5, 0.5, 0]) is None


def test_directions_are_spread_evenly() -> None:
    found = np.array(list(spread_directions(200)))
    assert np.sqrt((found**2).sum(axis=1)) == pytest.approx(1.0)
    assert found.mean(axis=0) == pytest.approx([0.0] * 3, abs=0.01)
    nearest = np.sort(found @ found.T, axis=1)[:, -2]
    assert np.arccos(nearest.clip(-1, 1)).min() > 0.5 * np.sqrt(4 * np.pi / 200)


def test_the_outermost_points_of_what_is_long_are_those_of_all_sides() -> None:
    corners = BOX * [100.0, 1.0, 1.0]
    inside = corners.mean(axis=0) + np.linspace(-0.2, 0.2, 30)[:, None] * [100.0, 1.0, 0.5]
    found = furthest(np.concatenate((inside, corners)), spread_directions(64))
    assert found.tolist() == corners.tolist()


@examples(40)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["cloud", "ball", "grid", "plate", "line", "far", "point"]))
def test_the_outermost_points_are_those_of_a_search_of_all(seed: int, kind: str) -> None:
    random = np.random.default_rng(seed)
    points = random.normal(size=(600, 3))
    if kind == "ball":
        points /= np.linalg.norm(points, axis=1, keepdims=True)
    elif kind == "grid":  # many points are equally distant
        points = points.round()
    elif kind == "far":
        points += 1e6
    else:
        points *= {"cloud": (1, 1, 1), "plate": (1, 1, 0), "line": (0, 1, 0), "point": (0, 0, 0)}[kind]
    directions = [(1.0, 0.0, 0.0), (0.0, 0.0, -1.0), *spread_directions(int(random.integers(1, 80)))]
    extents = np.ptp(points, axis=0)
    even = points / np.where(extents > 0, extents, 1.0)
    expected = sorted({int(along(even, np.array(direction)).argmax()) for direction in directions})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(convex_hull, "_MIN_POINTS_FOR_CELLS", 1)
        patch.setattr(convex_hull, "_cells_along_axis", lambda _: int(random.integers(1, 12)))
        assert furthest(points, directions).tobytes() == points[expected].tobytes()


@given(st.lists(st.tuples(*[st.floats(-2, 2)] * 3), min_size=4, max_size=20))
def test_what_was_drawn_in_is_grown_again(points: list[tuple[float, float, float]]) -> None:
    original = np.array(points)
    assert unshrunk(shrunk(original, 0.001), 0.001) == pytest.approx(original, abs=1e-9)
