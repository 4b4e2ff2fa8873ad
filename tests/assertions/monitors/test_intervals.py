"""Signals that stay between two bounds each."""

from __future__ import annotations

from sim_action.assertions.monitors import State
from sim_action.assertions.monitors.bounds import Interval, IntervalsMonitor
from tests.traces import trace

SEEN = trace([1.0, 2.0, 3.0], x=[0.5, 1.5, 1.0], speed=[10.0, 15.0, 19.0])
PLACE = Interval("x", "m", 0.0, 2.0, lambda seen: seen.base_position_xyz[:, 0])
SPEED = Interval("speed", "m/s", 0.0, 20.0, lambda seen: seen.speed)


def test_margins_are_compared_as_parts_of_their_scales() -> None:
    assert IntervalsMonitor((*PLACE.sides(), *SPEED.sides())).observe(SEEN).verdict().unit == "m"
    scaled = IntervalsMonitor((*PLACE.sides(2.0), *SPEED.sides(20.0))).observe(SEEN).verdict()
    assert (scaled.margin, scaled.message) == (
        1.0,
        "stayed within; nearest to speed = 20 m/s with speed = 19 m/s at 3.00 s",
    )


def test_a_bound_that_is_passed_breaks_it() -> None:
    narrow = Interval("x", "m", 0.75, 2.0, PLACE.signal)
    monitor = IntervalsMonitor(tuple(narrow.sides())).observe(SEEN)
    assert (monitor.state, monitor.verdict().message) == (State.BROKEN, "left past x = 0.75 m: x = 0.5 m at 1.00 s")
