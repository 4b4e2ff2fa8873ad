"""The robot comes to rest."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest

from sim_action.assertions.settled import Settled
from sim_action.scenario.model import DrivenRobot
from sim_action.state.verdict import Verdict
from tests.traces import BURGER, START, judged, scene, trace

SLOWING = trace([1.0, 2.0, 3.0, 4.0, 5.0], speed=[1.0, 0.25, 0.125, 0.0, 0.0], turn_rate=[0.0, 0.0, 1.0, 0.0, 0.0])


def settled(**keys: Any) -> Settled:
    return Settled.model_validate(keys)


def test_it_says_since_when_it_rests() -> None:
    assert judged(settled(), SLOWING) == Verdict(True, 1.0, 1.0, 0.0, "s", 5.0, "at rest from 4.00 s on, for 1 s")


def test_both_speeds_must_be_slow_at_once() -> None:
    assert judged(settled(speed=0.25), SLOWING).time == 5.0
    assert judged(settled(speed=0.25, turn_rate=1.0), SLOWING).time == 3.0


def test_a_rest_that_is_too_short_says_how_long_it_was_and_what_moves() -> None:
    again = trace([1.0, 2.0, 3.0, 4.0], speed=[0.0, 0.0, 0.5, 0.5])
    assert judged(settled(**{"for": "1.5 s"}), again) == Verdict(
        False,
        1.0,
        1.5,
        -0.5,
        "s",
        2.0,
        "at rest for 1 s of 1.5 s, from 1.00 s on; at 4.00 s the base moved with 0.5 m/s",
    )


def test_a_rest_that_would_have_gone_on_says_so() -> None:
    assert judged(settled(**{"for": "3 s"}), SLOWING).message == (
        "at rest for 1 s of 3 s, from 4.00 s on; at 5.00 s it still was"
    )


def test_what_never_rests_says_what_moves_most_as_a_part_of_its_limit() -> None:
    spinning = trace([1.0, 2.0], speed=[0.1, 0.1], turn_rate=[1.0, 1.0])
    assert judged(settled(), spinning).message == "at rest for 0 s of 1 s; at 2.00 s the base turned with 57.3 deg/s"


def test_an_interruption_of_one_step_begins_it_anew() -> None:
    bounced = trace([1.0, 1.5, 2.0, 2.5], speed=[0.0, 0.5, 0.0, 0.0])
    assert judged(settled(), bounced).measured == 0.5


def test_joints_count_if_asked_for() -> None:
    turning = trace([1.0, 2.0, 3.0], velocity=[-1.0, -1.0, -1.0])
    assert judged(settled(), turning).passed
    verdict = judged(settled(joints=True), turning)
    assert verdict.message == "at rest for 0 s of 1 s; at 3.00 s wheel_left_joint moved with 57.3 deg/s"


def test_joints_of_a_bolted_robot_count_by_themselves() -> None:
    bolted = dataclasses.replace(scene(), robot=DrivenRobot(model=BURGER, base="fixed"))
    turning = trace([1.0, 2.0, 3.0], velocity=[1.0, 1.0, 1.0])
    assert not settled().monitor(bolted, START).observe(turning).verdict().passed
    assert settled(joints=False).monitor(bolted, START).observe(turning).verdict().passed


def test_a_robot_that_jumps_is_not_at_rest() -> None:
    """A script that sets the pose of the robot again and again moves it without a velocity."""
    seen = trace([step / 240 for step in range(241)], x=[float(step // 24) for step in range(241)])
    verdict = judged(settled(**{"for": 0.5}), seen)
    assert not verdict.passed
    assert verdict.measured == pytest.approx(23 / 240)
