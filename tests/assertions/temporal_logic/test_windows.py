"""Many windows at once."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sim_action.assertions.temporal_logic.robustness import greatest_of_windows, least_of_windows, until

values = st.lists(st.integers(-5, 5).map(float), min_size=1, max_size=40)


@given(values, st.lists(st.tuples(st.integers(0, 40), st.integers(0, 40)), min_size=1))
def test_windows_of_any_length_anywhere(seen: list[float], ends: list[tuple[int, int]]) -> None:
    windows = [(min(a, b, len(seen)), min(max(a, b), len(seen))) for a, b in ends]
    first, last = (np.array(side, dtype=np.intp) for side in zip(*windows, strict=True))
    column = np.array(seen)
    least = [min(seen[a:b], default=math.inf) for a, b in windows]
    greatest = [max(seen[a:b], default=-math.inf) for a, b in windows]
    assert least_of_windows(column, first, last).tolist() == least
    assert greatest_of_windows(column, first, last).tolist() == greatest


@given(st.lists(st.tuples(st.integers(-5, 5), st.integers(-5, 5)), min_size=1, max_size=40))
def test_until_goes_backwards_one_by_one(pairs: list[tuple[int, int]]) -> None:
    before, then = (np.array(side, dtype=np.float64) for side in zip(*pairs, strict=True))
    expected, later = [], -math.inf
    for p, q in reversed(pairs):
        later = max(q, min(p, later))
        expected.append(later)
    assert until(before, then).tolist() == expected[::-1]


def test_what_is_given_stays_as_it_was() -> None:
    before, then = np.array([1.0, 2.0, 3.0]), np.array([3.0, 1.0, 0.0])
    until(before, then)
    assert (before.tolist(), then.tolist()) == ([1.0, 2.0, 3.0], [3.0, 1.0, 0.0])
