"""Surfaces of many triangles come down to few, and stay where they were."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.recording.replay import surfaces
from sim_action.recording.replay.scene_data import MeshData
from sim_action.world.parts import GridPart
from tests.soak import examples


def ball(rings: int, radius: float = 1.0) -> surfaces.Triangles:
    """A ball of 2 * rings^2 faces of four corners, in triangles."""
    up, round_ = np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, 2 * rings, endpoint=False)
    heights, turns = np.meshgrid(up, round_, indexing="ij")
    parts = (np.sin(heights) * np.cos(turns), np.sin(heights) * np.sin(turns), np.cos(heights))
    points = radius * np.stack(parts, axis=-1).reshape(-1, 3)
    rows = np.arange(len(points)).reshape(rings + 1, 2 * rings)
    a, b = rows[:-1], rows[1:]
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    faces = [np.stack(corners, axis=-1).reshape(-1, 3) for corners in ((a, b, c), (a, c, d))]
    return surfaces.Triangles(points, np.concatenate(faces).astype(np.int64))


def volume(surface: surfaces.Triangles) -> float:
    a, b, c = (surface.points_xyz[surface.corners[:, corner]] for corner in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


@pytest.mark.parametrize("most", [100, 500, 1_200])
def test_a_ball_of_few_triangles_is_a_ball(most: int) -> None:
    many = ball(60)
    few = surfaces.simplified(many, most)
    assert most / 3 < len(few) <= most
    distances = np.linalg.norm(few.points_xyz, axis=1)
    assert distances.min() > 0.8
    assert distances.max() <= 1.0 + 1e-9
    assert volume(few) == pytest.approx(4 / 3 * np.pi, rel=0.35)  # and its outside is outside


def test_budgets_of_triangles() -> None:
    # What has few triangles keeps them.
    few = ball(4)
    assert surfaces.simplified(few, 1_000) is few
    # Large surfaces get more of a budget.
    large, small = surfaces.within(surfaces.Budget(3_000, 2_000), [ball(40, 3.0), ball(40, 1.0)])
    assert len(large) > 2 * len(small) > 200
    assert (large.stated, small.stated) == (len(ball(40)), len(ball(40)))
    # A budget is shared by those that need it.
    small, large = ball(3), ball(40)
    assert [len(found) for found in surfaces.within(surfaces.Budget(1_000, 1_500), [small])] == [len(small)]
    kept = surfaces.within(surfaces.Budget(1_000, 1_500), [large, small, large])
    assert len(kept[1]) == len(small)
    assert sum(map(len, kept)) <= 1_500
    assert min(len(kept[0]), len(kept[2])) > 300


@given(st.integers(0, 2**32 - 1), st.integers(1, 400), st.integers(1, 50))
@examples(50)
def test_no_surface_is_beyond_its_budget(seed: int, count: int, most: int) -> None:
    numbers = np.random.default_rng(seed)
    points = numbers.normal(size=(count + 2, 3)) * numbers.choice([0.0, 1e-6, 1.0, 1e6], size=3)
    few = surfaces.simplified(surfaces.Triangles(points, numbers.integers(0, count + 2, size=(count, 3))), most)
    assert len(few) <= most
    assert (few.corners < len(few.points_xyz)).all()
    assert (few.corners >= 0).all()


@pytest.mark.parametrize("radius", [0.0, np.nan, np.inf])
def test_a_surface_without_an_extent_takes_nothing_from_the_others(radius: float) -> None:
    with np.errstate(invalid="ignore"):
        odd = ball(1, radius)
    _, kept = surfaces.within(surfaces.Budget(1_000, 1_000), [odd, ball(40)])
    assert len(kept) > 500


def test_stored_meshes() -> None:
    # A stored mesh is where the surface was.
    surface = surfaces.Triangles(ball(10).points_xyz + np.array([100.0, 0.0, -50.0]), ball(10).corners)
    mesh = surfaces.mesh_data(surface)
    assert mesh is not None
    points, corners = MeshData.model_validate_json(mesh.model_dump_json()).decoded()
    there = (points * mesh.scale)[corners]
    assert there.min(axis=(0, 1)) == pytest.approx([99, -1, -51], abs=2e-3)
    assert there.max(axis=(0, 1)) == pytest.approx([101, 1, -49], abs=2e-3)
    about = surfaces.Triangles(points * np.float64(mesh.scale) - np.array([100.0, 0.0, -50.0]), corners)
    assert volume(about) == pytest.approx(volume(ball(10)), rel=0.01)
    # Meshes that are alike have one name.
    first, second, other = (surfaces.mesh_data(ball(rings)) for rings in (5, 5, 6))
    assert first is not None
    assert second is not None
    assert other is not None
    assert surfaces.digest_of(first) == surfaces.digest_of(second) != surfaces.digest_of(other)


@pytest.mark.parametrize(
    "points", [np.zeros((3, 3)), np.array([[0, 0, 0], [1, 1, 1], [2, 2, np.nan]])], ids=["a point", "no number"]
)
def test_what_cannot_be_seen_is_no_mesh(points: np.ndarray) -> None:
    assert surfaces.mesh_data(surfaces.Triangles(points, np.array([[0, 1, 2]]))) is None


def test_mirrored_surfaces_and_heightfields() -> None:
    assert volume(ball(10).scaled((-1.0, 2.0, 1.0))) == pytest.approx(2 * volume(ball(10)))
    # A heightfield comes down to its samples and keeps its edges.
    x = np.linspace(-1, 1, 300)
    heights = x[None, :] ** 2 + 0.5 * np.linspace(-1, 1, 200)[:, None]
    surface = surfaces.coarse_surface(GridPart((4.0, 2.0), heights))
    assert len(surface) == 2 * (surfaces.MAX_GRID_SAMPLES - 1) ** 2
    assert surface.points_xyz.min(axis=0) == pytest.approx([-2, -1, heights.min()], abs=2e-3)
    assert surface.points_xyz.max(axis=0) == pytest.approx([2, 1, heights.max()], abs=2e-3)
    expected = (surface.points_xyz[:, 0] / 2) ** 2 + 0.5 * surface.points_xyz[:, 1]
    assert surface.points_xyz[:, 2] == pytest.approx(expected, abs=1e-3)
    # A small heightfield stays as it is.
    surface = surfaces.coarse_surface(GridPart((1.0, 1.0), np.array([[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]])))
    assert surface.points_xyz[:, 2].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
