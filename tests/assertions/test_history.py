"""A trace that grows."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sim_action.assertions.user_assertion import History
from sim_action.state.trace import Trace
from tests.traces import contact, piece, trace

MOMENTS = 40
SEEN = trace(
    [float(n) for n in range(MOMENTS)], x=[float(n) for n in range(MOMENTS)], contacts=[contact(3.0), contact(30.0)]
)


def grown(cuts: list[int], history: History | None = None) -> list[History]:
    """After each of the pieces between the cuts."""
    found = []
    for start, end in pairwise(cuts):
        following = piece(SEEN, start, end)
        history = History.of(following) if history is None else history.followed_by(following)
        found.append(history)
    return found


def same(one: Trace, other: Trace) -> bool:
    return np.array_equal(one.state, other.state) and one.contacts == other.contacts


@given(st.lists(st.integers(0, MOMENTS)).map(sorted))
def test_it_is_the_trace_however_that_is_cut(cuts: list[int]) -> None:
    for history, end in zip(grown([0, *cuts]), cuts, strict=True):
        assert same(history.whole(), piece(SEEN, 0, end))


def test_what_follows_a_moment_twice_does_not_change_what_followed_first() -> None:
    (early,) = grown([0, 10])
    first, *_ = grown([10, 20], early)
    other = early.followed_by(piece(SEEN, 30, 40))
    assert same(first.whole(), piece(SEEN, 0, 20))
    assert other.whole().time.tolist() == [*range(10), *range(30, 40)]
    assert len(early.whole()) == 10


def test_most_of_it_is_copied_once_or_twice_whatever_its_length() -> None:
    wholes = [history.whole().state for history in grown(list(range(MOMENTS)))]
    moved = sum(not np.shares_memory(before, after) for before, after in pairwise(wholes))
    assert 0 < moved <= math.log2(MOMENTS)
