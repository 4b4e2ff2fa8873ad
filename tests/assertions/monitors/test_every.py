"""Several limits that must all hold."""

from __future__ import annotations

from sim_action.assertions.monitors import State
from sim_action.assertions.monitors.bounds import AllLimits, Bounds, SignalMonitor
from tests.traces import trace

SEEN = trace([1.0, 2.0, 3.0], speed=[0.5, 1.5, 1.0], turn_rate=[1.0, 2.0, 8.0])


def limits(speed: float, turn_rate: float) -> AllLimits:
    return AllLimits(
        (
            SignalMonitor("speed", lambda seen: seen.speed, Bounds("moved with", "m/s", None, speed)),
            SignalMonitor("turn rate", lambda seen: seen.turn_rate, Bounds("turned with", "rad/s", None, turn_rate)),
        )
    )


def test_the_one_that_was_come_nearest_to_as_a_part_of_it_speaks() -> None:
    assert limits(2.0, 9.0).observe(SEEN).verdict().message.startswith("turned")
    assert limits(2.0, 80.0).observe(SEEN).verdict().message.startswith("moved")


def test_the_one_that_was_broken_first_speaks() -> None:
    broken = limits(1.0, 7.0).observe(SEEN)
    assert (broken.state, broken.verdict().time, broken.verdict().unit) == (State.BROKEN, 2.0, "m/s")


def test_all_must_hold() -> None:
    assert limits(2.0, 9.0).observe(SEEN).state is State.HOLDS
    assert limits(2.0, 7.0).observe(SEEN).state is State.BROKEN
