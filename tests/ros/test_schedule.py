"""Schedules: the rate of a topic holds on average."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.ros.schedule import Schedule


@pytest.mark.parametrize(("rate", "intervals"), [(30, {3, 4}), (40, {2, 3}), (50, {2}), (5, {20}), (100, {1})])
def test_messages_come_as_evenly_as_ticks_allow(rate: float, intervals: set[int]) -> None:
    schedule = Schedule.of(rate, 100)
    due = [tick for tick in range(1001) if schedule.is_due(tick)]

    assert {after - before for before, after in pairwise(due)} == intervals
    assert len(due) == 10 * rate + 1
    assert schedule.is_even == (len(intervals) == 1)


@pytest.mark.parametrize("rate", [0, -1, 100, 1000])
def test_no_rate_and_a_rate_above_that_of_the_ticks_mean_every_tick(rate: float) -> None:
    schedule = Schedule.of(rate, 100)
    assert schedule.rate == 100
    assert all(map(schedule.is_due, range(50)))


@given(st.floats(0.5, 200), st.sampled_from([60.0, 100.0, 120.0]), st.integers(1, 400))
def test_the_number_of_messages_follows_the_rate(rate: float, ticks: float, last: int) -> None:
    schedule = Schedule.of(rate, ticks)
    count = sum(map(schedule.is_due, range(last + 1)))
    assert abs(count - 1 - last * min(rate, ticks) / ticks) <= 1 + 1e-6
