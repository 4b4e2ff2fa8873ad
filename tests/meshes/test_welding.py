"""Equal points of a mesh become one, in a fixed order."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.meshes import mesh
from sim_action.meshes.mesh import welded
from tests.soak import examples

COORDINATES = st.sampled_from([0.0, -0.0, 1.0, -1.0, 1e-40, -1e-40, 0.5, 1e9])
ROWS = st.lists(st.tuples(COORDINATES, COORDINATES, COORDINATES), max_size=40)


Array = np.ndarray[Any, np.dtype[Any]]


def expected(points: Array) -> tuple[Array, Array]:
    """The same by sorting all rows, which keeps the first of equal ones."""
    wide = points.astype(np.float64)
    order = np.lexsort(wide.T)
    is_new = [bool(nth == 0 or (wide[row] != wide[order[nth - 1]]).any()) for nth, row in enumerate(order)]
    names = np.empty(len(wide), np.int64)
    names[order] = np.cumsum(is_new) - 1
    return wide[order[is_new]], names


@examples(100)
@given(ROWS, st.sampled_from([np.float32, np.float64]))
def test_equal_points_become_one(rows: list[tuple[float, float, float]], kind: type) -> None:
    points: Array = np.array(rows, kind).reshape(-1, 3)
    found, names = welded(points)
    wanted, wanted_names = expected(points)
    assert found.tobytes() == wanted.tobytes()  # also the sign of a zero
    assert names.tolist() == wanted_names.tolist()


@pytest.mark.parametrize("rounds", [0, 1, 6])
@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_many_points_are_sorted_by_z_then_y_then_x(kind: type, rounds: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mesh, "_MAX_ROUNDS", rounds)
    monkeypatch.setattr(mesh, "_CHUNK", 1000)
    points = np.random.default_rng(5).integers(-8, 8, (10_000, 3)).astype(kind) / 4
    found, names = welded(points)
    wanted, wanted_names = expected(points)
    assert (found.tobytes(), names.tobytes()) == (wanted.tobytes(), wanted_names.tobytes())
