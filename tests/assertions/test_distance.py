"""The distance of the robot from its start, and the length of its path."""

from __future__ import annotations

import pytest

from sim_action.assertions.distance import PathLength, Travel
from sim_action.assertions.monitors import State
from sim_action.assertions.monitors.windows import Window
from sim_action.core.geometry import Pose, Twist
from sim_action.state.observation import Observation
from sim_action.state.verdict import Verdict
from tests.traces import judged, monitor, piece, trace

SQUARE = trace([1.0, 2.0, 3.0, 4.0], x=[1.0, 1.0, 0.0, 0.0], y=[0.0, 1.0, 1.0, 0.0])
THERE_AND_BACK = trace([1.0, 2.0, 3.0], x=[0.5, 1.25, 0.25])


def test_a_goal_that_is_met_says_when() -> None:
    assert judged(Travel(at_least=1.0), THERE_AND_BACK) == Verdict(
        True, 1.25, 1.0, 0.25, "m", 2.0, "travelled 1.25 m in 2.00 s"
    )


def test_a_goal_is_met_at_its_limit() -> None:
    assert judged(Travel(at_least=1.25), THERE_AND_BACK).margin == 0.0


def test_a_shortfall_says_how_far_it_got() -> None:
    assert judged(Travel(at_least=1.5), THERE_AND_BACK) == Verdict(
        False, 1.25, 1.5, -0.25, "m", 2.0, "travelled 1.25 m of 1.5 m in 3.0 s"
    )


def test_an_upper_bound_that_holds_says_how_near_it_came() -> None:
    assert judged(Travel(at_most=1.5), THERE_AND_BACK) == Verdict(
        True, 1.25, 1.5, 0.25, "m", 2.0, "travelled at most 1.25 m, limit 1.5 m"
    )


def test_an_upper_bound_is_broken_at_the_first_moment_beyond() -> None:
    assert judged(Travel(at_most=1.0), THERE_AND_BACK) == Verdict(
        False, 1.25, 1.0, -0.25, "m", 2.0, "travelled 1.25 m at 2.00 s, more than 1 m"
    )


@pytest.mark.parametrize(
    ("at_least", "at_most", "state", "passed"),
    [(1.0, 1.5, State.HOLDS, True), (1.5, 2.0, State.PENDING, False), (0.5, 1.0, State.BROKEN, False)],
)
def test_with_both_bounds_a_broken_one_decides_else_the_goal(
    at_least: float, at_most: float, state: State, passed: bool
) -> None:
    seen = monitor(Travel(at_least=at_least, at_most=at_most)).observe(THERE_AND_BACK)
    assert seen.state is state
    assert seen.verdict().passed is passed


def test_travel_is_measured_on_the_ground_from_the_start() -> None:
    start = Observation(0.0, Pose((1.0, 1.0, 5.0)), Twist(), {})
    seen = trace([1.0], x=[4.0], y=[5.0], z=[100.0])
    assert judged(Travel(at_least=5.0), seen, start).measured == 5.0


def test_a_miss_by_a_hair_is_told_apart_from_the_limit() -> None:
    near = trace([1.0], x=[1.49999])
    assert judged(Travel(at_least=1.5), near).message == "travelled 1.49999 m of 1.5 m in 1.0 s"
    assert judged(Travel(at_most=1.49998), near).message == "travelled 1.49999 m at 1.00 s, more than 1.49998 m"


def test_the_way_adds_up_where_displacement_does_not() -> None:
    assert judged(PathLength(at_least=3.5), SQUARE) == Verdict(True, 4.0, 3.5, 0.5, "m", 4.0, "covered 4 m in 4.00 s")


def test_a_way_that_is_too_short() -> None:
    assert judged(PathLength(at_least=5.0), SQUARE) == Verdict(
        False, 4.0, 5.0, -1.0, "m", 4.0, "covered 4 m of 5 m in 4.0 s"
    )


def test_a_way_that_is_too_long() -> None:
    assert judged(PathLength(at_most=2.5), SQUARE) == Verdict(
        False, 3.0, 2.5, -0.5, "m", 3.0, "covered 3 m at 3.00 s, more than 2.5 m"
    )


def test_a_way_that_stays_within_its_limit() -> None:
    assert judged(PathLength(at_most=4.0), SQUARE) == Verdict(
        True, 4.0, 4.0, 0.0, "m", 4.0, "covered at most 4 m, limit 4 m"
    )


def test_the_way_begins_at_the_start_and_is_in_space() -> None:
    start = Observation(0.0, Pose((0.0, 0.0, 2.0)), Twist(), {})
    assert judged(PathLength(at_most=9.0), trace([1.0]), start).measured == 2.0


@pytest.mark.parametrize(("after", "length"), [(0.0, 4.0), (1.0, 3.0), (1.5, 3.0), (2.0, 2.0), (4.0, 0.0)])
def test_the_way_is_counted_since_after(after: float, length: float) -> None:
    # Out and back: a straight line from the start to where the window opens would be shorter, or 0.
    seen = Window(monitor(PathLength(at_most=9.0)), after)
    assert seen.observe(SQUARE).verdict().measured == length
    for block in range(4):
        seen = seen.observe(piece(SQUARE, block, block + 1))
    assert seen.verdict().measured == length
