"""How long something was so without interruption."""

from __future__ import annotations

import numpy as np
import pytest

from sim_action.assertions.monitors import State
from sim_action.assertions.monitors.goals import HoldTime

TIME = np.arange(1.0, 9.0)


def seen(*holds: int, wanted: float = 2.0) -> HoldTime:
    return HoldTime(wanted).observe(TIME[: len(holds)], np.array(holds, dtype=bool))


@pytest.mark.parametrize(
    ("holds", "began", "decided"),
    [((1, 1, 1), 1.0, 3.0), ((0, 1, 1, 0, 1, 1, 1, 1), 5.0, 7.0), ((0, 1, 1, 1), 2.0, 4.0)],
)
def test_it_is_met_once_the_stretch_is_long_enough(holds: tuple[int, ...], began: float, decided: float) -> None:
    met = seen(*holds)
    assert (met.state, met.began, met.goal.time, met.longest) == (State.HOLDS, began, decided, 2.0)


def test_the_longest_stretch_is_kept() -> None:
    missed = seen(1, 0, 1, 1, 0, 1)
    assert (missed.state, missed.longest, missed.began, missed.since) == (State.PENDING, 1.0, 3.0, 6.0)


def test_what_never_was_lasted_for_no_time() -> None:
    assert (HoldTime(2.0).longest, seen(0, 0).longest, seen(0, 0).state) == (0.0, 0.0, State.PENDING)


def test_a_stretch_of_no_time_is_met_by_the_first_moment() -> None:
    assert seen(0, 0, wanted=0.0).state is State.PENDING
    assert seen(0, 1, wanted=0.0).goal.time == 2.0


def test_rounding_of_sim_time_costs_no_step() -> None:
    time = np.arange(100, 400) / 240  # (340 - 100) / 240 is 1, but 340 / 240 - 100 / 240 is not
    for first in range(60):
        holds = np.arange(300) >= first
        assert HoldTime(1.0).observe(time, holds).goal.time == time[first + 240]
        assert HoldTime(2 / 240).observe(time, holds).goal.time == time[first + 2]
