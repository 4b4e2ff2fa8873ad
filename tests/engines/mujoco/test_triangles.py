"""Surfaces as thin convex pieces for MuJoCo."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

triangles = pytest.importorskip("sim_action.engines.mujoco.triangles", reason="mujoco is not installed")

ONE = np.array([[0, 1, 2]])


def test_a_piece_is_its_triangle_and_a_smaller_one_behind_it() -> None:
    corners = np.array([(0.0, 0, 0), (3, 0, 0), (0, 4, 0)])
    (piece,) = triangles.behind(corners, ONE)
    assert (piece[:3] == corners).all()
    assert piece[3:, 2] == pytest.approx([-triangles.THICKNESS] * 3)
    # At 45 degrees, all sides have moved in by as much as it is thick; its inner circle has a radius of 1.
    assert piece[3, :2] == pytest.approx([triangles.THICKNESS] * 2)


@given(st.integers(0, 2**32 - 1), st.floats(1e-4, 10))
def test_a_piece_stays_behind_its_triangle_however_small(seed: int, size: float) -> None:
    corners = size * np.random.default_rng(seed).normal(size=(3, 3))
    (piece,) = triangles.behind(corners, ONE)
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal /= np.linalg.norm(normal)
    above = (piece - corners[0]) @ normal
    assert above[:3] == pytest.approx([0] * 3, abs=1e-9 * size)
    assert (above[3:] < 0).all()
    assert (above[3:] >= -triangles.THICKNESS - 1e-12).all()
    # Seen from above, it is within the triangle.
    for start, end in ((0, 1), (1, 2), (2, 0)):
        inward = np.cross(normal, corners[end] - corners[start])
        assert ((piece - corners[start]) @ inward >= -1e-9 * size**2).all()
