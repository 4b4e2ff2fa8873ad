"""The timeline of a run: which marks a failure names, and in which order they are kept."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.state.timeline import MAX_TIME_MARKS, TimeMark, in_order, nearest_causes

PUSH = TimeMark(1.0, 1.2, "pushed with 8 N")
FAULT = TimeMark(0.5, None, "motor of joint 'left' is off")
LATE = TimeMark(0.0, None, "messages of commands[0] arrived 0.4 s late")
START = TimeMark(0.0, 0.0, "commanded 0.2 m/s", is_planned=True)
TURN = TimeMark(1.5, 1.5, "commanded 0.5 rad/s", is_planned=True)


@pytest.mark.parametrize(
    ("marks", "time", "named"),
    [
        ([], 1.0, []),
        ([PUSH], 0.9, []),
        ([PUSH], 1.0, [PUSH]),
        ([PUSH, TURN], 2.0, [TURN, PUSH]),
        ([FAULT, PUSH, TURN], 2.0, [TURN, PUSH, FAULT]),
        ([FAULT, PUSH], 0.7, [FAULT]),
        ([LATE], 3.0, [LATE]),
        ([LATE, TURN], 3.0, [TURN]),
        ([LATE, PUSH], 3.0, [PUSH]),
        ([TURN], 1.6, [TURN]),
    ],
)
def test_a_failure_names_the_nearest_marks_before_it(marks: list[TimeMark], time: float, named: list[TimeMark]) -> None:
    assert list(nearest_causes(marks, time)) == named


def test_a_title_has_the_times() -> None:
    assert PUSH.title == "pushed with 8 N at 1.00 s for 0.2 s"
    assert FAULT.title == "motor of joint 'left' is off from 0.50 s on"
    assert TURN.title == "commanded 0.5 rad/s at 1.50 s"


@given(st.lists(st.builds(TimeMark, st.floats(0, 9), st.none(), st.just("a"), st.booleans())), st.floats(0, 9))
def test_no_mark_after_a_failure_explains_it(marks: list[TimeMark], time: float) -> None:
    """Three at most, none later than the failure, and one of the last ones among them."""
    named = nearest_causes(marks, time)
    before = [mark.time for mark in marks if mark.time <= time]
    assert len(named) <= 3
    assert [mark.time for mark in named] == sorted((mark.time for mark in named), reverse=True)
    assert not before or named[0].time == pytest.approx(max(before), abs=1e-9)


def test_results_keep_the_first_marks() -> None:
    """A command at 0 s is no news."""
    assert in_order([START, PUSH, LATE], end=3.0) == (LATE, PUSH)
    many = [TimeMark(float(number), None, "a") for number in range(MAX_TIME_MARKS + 9)]
    kept = in_order(reversed(many), end=1e9)
    assert kept == tuple(many[:MAX_TIME_MARKS])
    assert in_order(many, end=3.0) == tuple(many[:4])
