"""The distance of convex bodies, against closed forms and against a search by chance."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from sim_action.simulation.convex_pieces import hull_distance


def box(size: tuple[float, float, float], at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> NDArray[np.float64]:
    signs = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    return signs * size + at


coordinates = st.floats(-5, 5).map(lambda value: round(value, 3))
places = st.tuples(coordinates, coordinates, coordinates)
lengths = st.floats(0.001, 4).map(lambda value: round(value, 3))
sizes = st.tuples(lengths, lengths, lengths)


@given(sizes, places, sizes, places)
def test_boxes_are_as_far_apart_as_their_sides(
    one: tuple[float, float, float],
    here: tuple[float, float, float],
    other: tuple[float, float, float],
    there: tuple[float, float, float],
) -> None:
    gaps = [max(0.0, abs(a - b) - (m + n) / 2) for a, b, m, n in zip(here, there, one, other, strict=True)]
    assert hull_distance(box(one, here), box(other, there)) == pytest.approx(math.hypot(*gaps), abs=1e-6)


@given(st.integers(0, 10_000), st.integers(1, 30), st.integers(1, 30))
def test_no_two_points_of_the_hulls_are_nearer(seed: int, few: int, many: int) -> None:
    draw = np.random.default_rng(seed)
    one, other = draw.normal(size=(few, 3)), draw.normal(size=(many, 3)) + draw.normal(size=3) * 3
    found = hull_distance(one, other)
    weights = draw.dirichlet(np.full(few, 0.3), 200) @ one, draw.dirichlet(np.full(many, 0.3), 200) @ other
    assert found <= np.linalg.norm(weights[0] - weights[1], axis=1).min() + 1e-9
    for limit in (0.5 * found, 2 * found):
        assert (hull_distance(one, other, limit) > limit) == (found > limit)


@pytest.mark.parametrize("enough", [math.inf, 0.1])
def test_points_and_segments_are_bodies_too(enough: float) -> None:
    point, segment = np.array([[0.0, 0.0, 0.3]]), np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    assert hull_distance(point, point) == 0.0
    assert hull_distance(point, segment, enough) == pytest.approx(0.3)
    assert hull_distance(np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]]), segment) == pytest.approx(0.0, abs=1e-9)
