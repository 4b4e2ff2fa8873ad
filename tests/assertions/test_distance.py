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


@pytest.mark.parametrize(
    ("spec", "passed", "limit", "message"),
    [
        (Travel(at_least=1.0), True, 1.0, "travelled 1.25 m in 2.00 s"),
        (Travel(at_least=1.25), True, 1.25, "travelled 1.25 m in 2.00 s"),
        (Travel(at_least=1.5), False, 1.5, "travelled 1.25 m of 1.5 m in 3.0 s"),
        (Travel(at_most=1.5), True, 1.5, "travelled at most 1.25 m, limit 1.5 m"),
        (Travel(at_most=1.0), False, 1.0, "travelled 1.25 m at 2.00 s, more than 1 m"),
    ],
    ids=["goal met", "at its limit", "shortfall", "upper bound", "first moment beyond"],
)
def test_a_bound_says_when_it_was_met_or_broken(spec: Travel, passed: bool, limit: float, message: str) -> None:
    margin = abs(1.25 - limit) * (1 if passed else -1)
    assert judged(spec, THERE_AND_BACK) == Verdict(passed, 1.25, limit, margin, "m", 2.0, message)


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


@pytest.mark.parametrize(
    ("spec", "verdict"),
    [
        (PathLength(at_least=3.5), Verdict(True, 4.0, 3.5, 0.5, "m", 4.0, "covered 4 m in 4.00 s")),
        (PathLength(at_least=5.0), Verdict(False, 4.0, 5.0, -1.0, "m", 4.0, "covered 4 m of 5 m in 4.0 s")),
        (PathLength(at_most=2.5), Verdict(False, 3.0, 2.5, -0.5, "m", 3.0, "covered 3 m at 3.00 s, more than 2.5 m")),
        (PathLength(at_most=4.0), Verdict(True, 4.0, 4.0, 0.0, "m", 4.0, "covered at most 4 m, limit 4 m")),
    ],
    ids=["long enough", "too short", "too long", "within its limit"],
)
def test_the_way_adds_up_where_displacement_does_not(spec: PathLength, verdict: Verdict) -> None:
    assert judged(spec, SQUARE) == verdict


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
