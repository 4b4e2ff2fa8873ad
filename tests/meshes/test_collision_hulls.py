"""The margin of an engine is taken off hulls, and given back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.meshes.collision_hulls import shrunk, unshrunk


@given(st.lists(st.tuples(*[st.floats(-2, 2)] * 3), min_size=4, max_size=20))
def test_what_was_drawn_in_is_grown_again(points: list[tuple[float, float, float]]) -> None:
    original = np.array(points)
    assert unshrunk(shrunk(original, 0.001), 0.001) == pytest.approx(original, abs=1e-9)
