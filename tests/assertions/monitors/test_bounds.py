"""Scalars against `at_least` and `at_most`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from sim_action.assertions.distance import PathLength, Travel
from sim_action.assertions.monitors import State
from sim_action.assertions.monitors.bounds import (
    AllLimits,
    Bounds,
    ClosestApproach,
    Goal,
    Interval,
    IntervalsMonitor,
    Invariant,
    SignalMonitor,
    joined,
)
from sim_action.core.lazy_numpy import FloatArray
from sim_action.state.trace import Trace
from tests.traces import trace

both = pytest.mark.parametrize("kind", [Travel, PathLength])


@both
@pytest.mark.parametrize(
    ("bounds", "message"),
    [
        ({}, "give 'at_least', 'at_most' or both"),
        ({"at_least": 2, "at_most": 1}, "nothing is at least 2 m and at most 1 m; swap the two?"),
        ({"at_least": 0}, "greater than 0"),
        ({"at_least": "-1 m"}, "greater than 0"),
        ({"at_most": "-1 m"}, "greater than or equal to 0"),
        ({"at_least": "1 s"}, "'s' is not a unit of length"),
        ({"at_leest": 1}, "Extra inputs"),
    ],
)
def test_bounds_that_ask_for_nothing_or_the_impossible_are_refused(
    kind: type[Travel | PathLength], bounds: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValidationError, match=message):
        kind.model_validate(bounds)


@pytest.mark.parametrize(
    ("bounds", "title"),
    [
        ({"at_least": 1.5}, "travel at least 1.5 m"),
        ({"at_most": 0}, "travel at most 0 m"),
        ({"at_least": "150 cm", "at_most": "2 m"}, "travel at least 1.5 m, at most 2 m"),
    ],
)
def test_the_title_says_what_is_asked(bounds: dict[str, Any], title: str) -> None:
    assert Travel.model_validate(bounds).title == title


SEEN = trace([1.0, 2.0, 3.0], speed=[0.5, 1.5, 1.0], turn_rate=[1.0, 2.0, 8.0])


def limits(speed: float, turn_rate: float) -> AllLimits:
    moved, turned = Bounds("moved with", "m/s", None, speed), Bounds("turned with", "rad/s", None, turn_rate)
    linear = SignalMonitor("speed", lambda seen: seen.speed, moved)
    return AllLimits((linear, SignalMonitor("turn rate", lambda seen: seen.turn_rate, turned)))


def test_all_must_hold_and_the_one_that_was_come_nearest_to_or_was_broken_first_speaks() -> None:
    assert limits(2.0, 9.0).observe(SEEN).state is State.HOLDS
    assert limits(2.0, 7.0).observe(SEEN).state is State.BROKEN
    assert limits(2.0, 9.0).observe(SEEN).verdict().message.startswith("turned")
    assert limits(2.0, 80.0).observe(SEEN).verdict().message.startswith("moved")
    broken = limits(1.0, 7.0).observe(SEEN)
    assert (broken.state, broken.verdict().time, broken.verdict().unit) == (State.BROKEN, 2.0, "m/s")


MOMENT = trace([1.0, 2.0, 3.0], x=[0.5, 1.5, 1.0], speed=[10.0, 15.0, 19.0])
PLACE = Interval("x", "m", 0.0, 2.0, lambda seen: seen.base_position_xyz[:, 0])
SPEED = Interval("speed", "m/s", 0.0, 20.0, lambda seen: seen.speed)


def test_margins_are_compared_as_parts_of_their_scales() -> None:
    assert IntervalsMonitor((*PLACE.sides(), *SPEED.sides())).observe(MOMENT).verdict().unit == "m"
    scaled = IntervalsMonitor((*PLACE.sides(2.0), *SPEED.sides(20.0))).observe(MOMENT).verdict()
    assert scaled.margin == 1.0
    assert scaled.message == "stayed within bounds; closest to speed = 20 m/s with speed = 19 m/s at 3.00 s"
    # A bound that is passed breaks it.
    narrow = Interval("x", "m", 0.75, 2.0, PLACE.signal)
    monitor = IntervalsMonitor(tuple(narrow.sides())).observe(MOMENT)
    assert monitor.state is State.BROKEN
    assert monitor.verdict().message == "crossed the bound x = 0.75 m: x = 0.5 m at 1.00 s"


@pytest.mark.parametrize(("at_most", "reads"), [(None, 2), (2.0, 3)])
def test_a_signal_is_read_until_its_verdict_is_known(at_most: float | None, reads: int) -> None:
    read: list[Trace] = []

    def signal(seen: Trace) -> FloatArray:
        read.append(seen)
        return seen.speed

    monitor = SignalMonitor("speed", signal, Bounds("moved with", "m/s", 1.0, at_most))
    pieces = [trace([time], speed=[speed]) for time, speed in ((1.0, 0.5), (2.0, 1.5), (3.0, 2.5))]
    for piece in pieces:
        monitor = monitor.observe(piece)
    assert len(read) == reads
    assert monitor.verdict().passed is (at_most is None)
    if at_most is None:
        assert (monitor.verdict().measured, monitor.verdict().time) == (1.5, 2.0)


TIME = np.array([1.0, 2.0, 3.0, 4.0])


def margins(*values: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.array(values, dtype=np.float64)


@pytest.mark.parametrize(
    ("margin", "goal"),
    [
        ((-3, -2, 1, 2), Goal(1.0, 3.0, State.HOLDS)),
        ((0, 5, 5, 5), Goal(0.0, 1.0, State.HOLDS)),
        ((-3, -1, -2, -1), Goal(-1.0, 2.0, State.PENDING)),
    ],
)
def test_a_goal_keeps_the_moment_it_came_true_or_its_best(margin: tuple[float, ...], goal: Goal) -> None:
    assert Goal().observe(TIME, margins(*margin)) == goal


@pytest.mark.parametrize(
    ("margin", "invariant"),
    [
        ((3, 1, 2, 1), Invariant(1.0, 2.0, State.HOLDS)),
        ((0, 0, 0, 0), Invariant(0.0, 1.0, State.HOLDS)),
        ((3, -1, -2, 5), Invariant(-1.0, 2.0, State.BROKEN)),
    ],
)
def test_an_invariant_keeps_the_moment_it_broke_or_its_worst(margin: tuple[float, ...], invariant: Invariant) -> None:
    assert Invariant().observe(TIME, margins(*margin)) == invariant


def test_what_is_decided_stays_decided() -> None:
    met = Goal().observe(TIME, margins(1, 1, 1, 1))
    assert met.observe(TIME, margins(9, 9, 9, 9)) is met
    broken = Invariant().observe(TIME, margins(-1, 1, 1, 1))
    assert broken.observe(TIME, margins(-9, -9, -9, -9)) is broken
    # No moments change nothing.
    goal, invariant = Goal(), Invariant()
    assert goal.observe(TIME[:0], margins()) is goal
    assert invariant.observe(TIME[:0], margins()) is invariant


def test_what_is_not_a_number_neither_meets_a_goal_nor_holds() -> None:
    assert Goal().observe(TIME, margins(*[math.nan] * 4)).state is State.PENDING
    broken = Invariant().observe(TIME, margins(1, 1, math.nan, 1))
    assert (broken.state, broken.time) == (State.BROKEN, 3.0)


@pytest.mark.parametrize(
    ("states", "all_of_them"),
    [
        ((), State.HOLDS),
        ((State.HOLDS, State.HOLDS), State.HOLDS),
        ((State.HOLDS, State.PENDING), State.PENDING),
        ((State.PENDING, State.BROKEN), State.BROKEN),
    ],
)
def test_several_states_join_to_the_worst(states: tuple[State, ...], all_of_them: State) -> None:
    assert joined(*states) is all_of_them


DISTANCE_TIME = np.array([1.0, 2.0, 3.0])
ELBOW = ClosestApproach("elbow came", "90 deg", "rad", 0.25)


def test_the_first_moment_within_the_tolerance_counts() -> None:
    seen = ELBOW.observe(DISTANCE_TIME, np.array([0.5, 0.25, 0.0]))
    assert (seen.state, seen.distance, seen.goal.time) == (State.HOLDS, 0.25, 2.0)
    assert seen.observe(DISTANCE_TIME + 3, np.zeros(3)).verdict() == seen.verdict()


def test_a_heading_counts_as_a_part_of_its_tolerance() -> None:
    turned = ClosestApproach("came", "(2, 0)", "m", 0.5, angle_tolerance=0.25)
    seen = turned.observe(DISTANCE_TIME, np.array([0.0, 0.25, 2.0]), np.array([1.0, 0.5, 0.0]))
    # Twice the angle that is allowed, at the second moment, is the least of what is too much.
    assert (seen.goal.margin, seen.distance, seen.angle_error, seen.goal.time) == (-0.5, 0.25, 0.5, 2.0)
    message = "came no closer than 0.25 m to (2, 0), 28.65 deg off its heading, in 3.0 s; closest at 2.00 s"
    assert seen.verdict().message == message
    # Without a moment, nothing came near.
    assert ELBOW.observe(DISTANCE_TIME[:0], DISTANCE_TIME[:0]) is ELBOW
    assert ELBOW.verdict().message == "no physics step to measure"
