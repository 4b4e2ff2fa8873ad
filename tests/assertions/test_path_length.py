"""How long a way the robot made."""

from __future__ import annotations

import pytest

from sim_action.assertions.monitors.window import Window
from sim_action.assertions.path_length import PathLength
from sim_action.core.geometry import Pose, Twist
from sim_action.state.observation import Observation
from sim_action.state.verdict import Verdict
from tests.traces import judged, monitor, piece, trace

SQUARE = trace([1.0, 2.0, 3.0, 4.0], x=[1.0, 1.0, 0.0, 0.0], y=[0.0, 1.0, 1.0, 0.0])


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


def test_the_way_between_two_blocks_counts() -> None:
    seen = monitor(PathLength(at_most=9.0))
    for block in (trace([1.0], x=[1.0]), trace([]), trace([2.0], x=[3.0])):
        seen = seen.observe(block)
    assert seen.verdict().measured == 3.0


@pytest.mark.parametrize(("after", "length"), [(0.0, 4.0), (1.0, 3.0), (1.5, 3.0), (2.0, 2.0), (4.0, 0.0)])
def test_the_way_is_counted_since_after(after: float, length: float) -> None:
    # Out and back: a straight line from the start to where the window opens would be shorter, or 0.
    seen = Window(monitor(PathLength(at_most=9.0)), after)
    assert seen.observe(SQUARE).verdict().measured == length
    for block in range(4):
        seen = seen.observe(piece(SQUARE, block, block + 1))
    assert seen.verdict().measured == length
