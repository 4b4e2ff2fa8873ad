"""Which commands of a log are given at a tick."""

from __future__ import annotations

import pytest

from sim_action.commands.logs import Moment
from sim_action.commands.replay import Playback
from sim_action.core.geometry import Twist
from sim_action.state.command import Command, JointTargets

SLOW, FAST = Twist.planar(0.1), Twist.planar(0.9)
LOG: list[Moment] = [(0.0, SLOW), (1.0, FAST), (2.0, SLOW)]


def given_at(times: list[float], log: list[Moment], start: float = 0.0, timeout: float | None = None) -> list[object]:
    playback = Playback(log, start, timeout)
    return [playback.command(time) for time in times]


def test_a_command_is_given_once_and_holds() -> None:
    assert given_at([0.0, 0.5, 1.0, 1.5, 2.0, 99.0], LOG) == [SLOW, None, FAST, None, SLOW, None]


def test_of_what_falls_between_two_ticks_the_last_is_given_at_the_later_one() -> None:
    assert given_at([0.0, 5.0], LOG) == [SLOW, SLOW]
    assert given_at([0.0, 1.9], LOG) == [SLOW, FAST]


def test_a_tick_on_a_moment_counts_whatever_the_rounding_of_either() -> None:
    log: list[Moment] = [(n * 0.1, Twist.planar(float(n))) for n in range(30)]
    assert given_at([n / 10 for n in range(30)], log) == [Twist.planar(float(n)) for n in range(30)]


@pytest.mark.parametrize(("start", "first"), [(0.0, SLOW), (0.99, SLOW), (1.0, FAST), (1.5, FAST), (2.0, SLOW)])
def test_what_holds_at_the_start_is_given_first(start: float, first: Command) -> None:
    assert given_at([0.0], LOG, start) == [first]


def test_from_the_start_on_times_are_those_of_the_log() -> None:
    assert given_at([0.0, 0.4, 0.5, 1.5], LOG, 0.5) == [SLOW, None, FAST, SLOW]


def test_a_twist_that_is_too_old_stops_the_base_until_the_next() -> None:
    times = [0.0, 0.3, 0.4, 0.9, 1.0, 1.4]
    assert given_at(times, LOG, timeout=0.3) == [SLOW, None, Twist(), Twist(), FAST, Twist()]


def test_a_twist_may_be_too_old_at_the_start() -> None:
    assert given_at([0.0, 0.5], LOG, 0.5, timeout=0.3) == [Twist(), FAST]


def test_joints_that_a_later_row_does_not_name_keep_what_they_were_told_between_two_ticks() -> None:
    log: list[Moment] = [
        (0.0, JointTargets(position={"a": 1.0, "b": 1.0})),
        (0.1, JointTargets(position={"a": 2.0})),
        (0.2, JointTargets(velocity={"b": 3.0})),
    ]
    assert given_at([0.05, 0.2], log) == [log[0][1], JointTargets(position={"a": 2.0}, velocity={"b": 3.0})]
    assert given_at([0.2], log) == [JointTargets(position={"a": 2.0}, velocity={"b": 3.0})]
