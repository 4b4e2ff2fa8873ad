"""How much work the motors do."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest

from sim_action.assertions.energy import Energy
from sim_action.assertions.temporal_logic.windows import Window
from sim_action.state.observation import JointState
from sim_action.state.verdict import Verdict
from tests.traces import START, WHEELS, judged, monitor, scene, trace

# Steps of 2 s: from 0 to 1 rad/s with 3 N m, 1 to 2 with 2 N m, then braked from 2 to 0 with 1 N m.
SEEN = trace([2.0, 4.0, 6.0], velocity=[1.0, 2.0, 0.0], effort=[3.0, 2.0, -1.0])
WORK = [3.0 * 0.5 * 2, 2.0 * 1.5 * 2, -1.0 * 1.0 * 2]


@pytest.mark.parametrize(("braking", "used"), [("free", 9.0), ("costs", 11.0), ("regained", 7.0)])
def test_work_is_effort_times_the_way_at_the_mean_velocity(braking: Any, used: float) -> None:
    assert WORK == [3.0, 6.0, -2.0]
    opened = monitor(Energy(at_most=20.0, braking=braking)).observe(SEEN)
    assert opened.verdict().measured == (used if braking != "regained" else 9.0)  # of what is regained, the most


def test_the_moment_that_it_was_too_much() -> None:
    assert judged(Energy(at_most=5.0), SEEN) == Verdict(
        False, 9.0, 5.0, -4.0, "J", 4.0, "used 9 J at 4.00 s, more than 5 J"
    )
    assert judged(Energy(at_most=10.0), SEEN) == Verdict(True, 9.0, 10.0, 1.0, "J", 4.0, "used at most 9 J, limit 10 J")


def test_what_is_regained_is_taken_off() -> None:
    again = trace([2.0, 4.0], velocity=[2.0, 0.0], effort=[1.0, -1.0])
    twice = trace([6.0, 8.0], velocity=[2.0, 0.0], effort=[1.0, -1.0])
    assert monitor(Energy(at_most=2.0, braking="regained")).observe(again).observe(twice).verdict().passed
    assert not monitor(Energy(at_most=2.0)).observe(again).observe(twice).verdict().passed


def test_it_goes_on_from_the_velocity_at_the_start() -> None:
    rolling = dataclasses.replace(START, joints={WHEELS[0]: JointState(0.0, 1.0, 0.0)})
    assert judged(Energy(at_most=20.0), trace([2.0], velocity=[1.0], effort=[3.0]), rolling).measured == 6.0


def test_work_before_the_window_does_not_count() -> None:
    seen = Window(monitor(Energy(at_most=20.0)), after=2.0).observe(SEEN)
    assert seen.verdict().measured == 6.0


def test_joints_may_be_named() -> None:
    assert judged(Energy(at_most=20.0, joints=("*_right_*",)), SEEN).measured == 0.0


def test_a_joint_that_is_not_there_is_a_problem() -> None:
    ((path, _),) = Energy(at_most=1.0, joints=("elbow",)).problems(scene())
    assert path == ("joints", 0)
