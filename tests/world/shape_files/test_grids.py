"""Cells as few rectangles."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from sim_action.world.shape_files.grids import rectangles


@given(arrays.arrays(np.bool_, st.tuples(st.integers(1, 12), st.integers(1, 12))))
def test_each_cell_is_in_one_rectangle_and_no_other_is(cells: np.ndarray) -> None:
    covered = np.zeros(cells.shape, int)
    for left, right, low, high in rectangles(cells, 1000) or ():
        covered[low:high, left:right] += 1
    assert (covered == cells).all()


def test_a_frame_is_four_and_a_block_one() -> None:
    block = np.ones((1000, 1000), np.bool_)
    assert rectangles(block, 10) == [(0, 1000, 0, 1000)]
    frame = block.copy()
    frame[1:-1, 1:-1] = False
    assert len(rectangles(frame, 10) or ()) == 4


def test_what_comes_to_too_many_is_told() -> None:
    assert rectangles(np.indices((50, 50)).sum(axis=0) % 2 == 0, 100) is None
