"""Damped least squares, against its definition: at the least, every derivative of the sum of squares is zero."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.least_squares import damped_least_squares, square_sum
from tests.soak import examples

numbers = st.floats(-10, 10)
vectors = st.tuples(numbers, numbers, numbers)


@given(st.lists(vectors, min_size=1, max_size=5), vectors, st.floats(1e-3, 10))
@examples(20)
def test_every_derivative_is_zero(
    columns: list[tuple[float, float, float]], error: tuple[float, float, float], damping: float
) -> None:
    found = damped_least_squares(columns, error, damping)
    rest = [
        math.fsum(column[row] * part for column, part in zip(columns, found, strict=True)) - error[row]
        for row in range(3)
    ]
    for column, part in zip(columns, found, strict=True):
        derivative = math.fsum(a * b for a, b in zip(column, rest, strict=True)) + damping * part
        assert derivative == pytest.approx(0.0, abs=1e-6)


def test_without_columns_nothing_moves() -> None:
    assert damped_least_squares([], (1.0, 2.0, 3.0), 0.1) == []


def test_the_square_of_a_vector() -> None:
    assert square_sum((3.0, 4.0)) == 25.0
