"""What the motors exert."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest

from sim_action.assertions.effort import Effort, Energy
from sim_action.assertions.monitors import State
from sim_action.assertions.monitors.windows import Window
from sim_action.state.observation import JointState
from sim_action.state.verdict import Verdict
from tests.traces import START, WHEELS, judged, monitor, scene, trace

WHEEL = WHEELS[0]
SEEN = trace([1.0, 2.0, 3.0, 4.0], effort=[3.0, -4.0, 0.0, 5.0])


def test_both_directions_count() -> None:
    message = f"{WHEEL} exerted 4 N m at 2.00 s, more than 3.5 N m"
    assert judged(Effort(at_most=3.5), SEEN) == Verdict(False, 4.0, 3.5, -0.5, "N m", 2.0, message, joint=WHEEL)
    message = f"{WHEEL} exerted at most 5 N m, limit 6 N m"
    assert judged(Effort(at_most=6.0), SEEN) == Verdict(True, 5.0, 6.0, 1.0, "N m", 4.0, message, joint=WHEEL)


def test_the_root_mean_square_is_of_the_whole_run() -> None:
    rms = math.sqrt((9 + 16 + 25) / 4)
    verdict = judged(Effort(rms_at_most=4.0), SEEN)
    assert (verdict.passed, verdict.measured, verdict.time) == (True, rms, 4.0)
    assert verdict.message == f"{WHEEL} exerted 3.536 N m RMS until 4.00 s, limit 4 N m"
    failing = judged(Effort(rms_at_most=3.5), SEEN)
    assert failing.margin == pytest.approx(3.5 - rms)
    assert failing.message == f"{WHEEL} exerted 3.536 N m RMS until 4.00 s, more than 3.5 N m"


def test_a_peak_may_be_made_up_for() -> None:
    opened = monitor(Effort(rms_at_most=1.0))
    peak = opened.observe(trace([1.0], effort=[2.0]))
    assert (peak.state, peak.verdict().passed) == (State.HOLDS, False)
    assert peak.observe(trace([2.0, 3.0, 4.0, 5.0])).verdict().passed


def test_of_both_limits_the_one_that_is_broken_speaks_and_joints_may_be_named() -> None:
    assert "RMS" in judged(Effort(at_most=6.0, rms_at_most=3.0), SEEN).message
    assert "RMS" not in judged(Effort(at_most=4.5, rms_at_most=4.0), SEEN).message
    assert judged(Effort(joints=("*_right_*",), at_most=1.0), SEEN).passed
    assert not judged(Effort(joints=(WHEEL,), at_most=1.0), SEEN).passed


def test_a_limit_in_the_unit_of_another_kind_of_joint_is_a_problem() -> None:
    ((path, message),) = Effort(at_most="5 N").problems(scene())
    assert path == ("at_most",)
    assert message.startswith(f"joint '{WHEEL}' turns: 'N' is not a unit of torque")
    assert message.endswith("; select joints of one kind with 'joints'")
    # So is a joint that is not there.
    for spec in (Effort(joints=("elbow",), at_most=5), Energy(at_most=1.0, joints=("elbow",))):
        ((path, _),) = spec.problems(scene())
        assert path == ("joints", 0)


# Steps of 2 s: from 0 to 1 rad/s with 3 N m, 1 to 2 with 2 N m, then braked from 2 to 0 with 1 N m.
MOVED = trace([2.0, 4.0, 6.0], velocity=[1.0, 2.0, 0.0], effort=[3.0, 2.0, -1.0])
WORK = [3.0 * 0.5 * 2, 2.0 * 1.5 * 2, -1.0 * 1.0 * 2]


@pytest.mark.parametrize(("braking", "used"), [("free", 9.0), ("costs", 11.0), ("regained", 7.0)])
def test_work_is_effort_times_the_way_at_the_mean_velocity(braking: Any, used: float) -> None:
    assert WORK == [3.0, 6.0, -2.0]
    opened = monitor(Energy(at_most=20.0, braking=braking)).observe(MOVED)
    assert opened.verdict().measured == (used if braking != "regained" else 9.0)  # of what is regained, the most


def test_the_moment_that_it_was_too_much() -> None:
    message = "used 9 J at 4.00 s, more than 5 J"
    assert judged(Energy(at_most=5.0), MOVED) == Verdict(False, 9.0, 5.0, -4.0, "J", 4.0, message)
    message = "used at most 9 J, limit 10 J"
    assert judged(Energy(at_most=10.0), MOVED) == Verdict(True, 9.0, 10.0, 1.0, "J", 4.0, message)


def test_what_is_regained_is_taken_off() -> None:
    again = trace([2.0, 4.0], velocity=[2.0, 0.0], effort=[1.0, -1.0])
    twice = trace([6.0, 8.0], velocity=[2.0, 0.0], effort=[1.0, -1.0])
    assert monitor(Energy(at_most=2.0, braking="regained")).observe(again).observe(twice).verdict().passed
    assert not monitor(Energy(at_most=2.0)).observe(again).observe(twice).verdict().passed


def test_it_goes_on_from_the_velocity_at_the_start() -> None:
    rolling = dataclasses.replace(START, joints={WHEELS[0]: JointState(0.0, 1.0, 0.0)})
    assert judged(Energy(at_most=20.0), trace([2.0], velocity=[1.0], effort=[3.0]), rolling).measured == 6.0


def test_the_work_of_named_joints_counts_but_none_before_the_window() -> None:
    seen = Window(monitor(Energy(at_most=20.0)), after=2.0).observe(MOVED)
    assert seen.verdict().measured == 6.0
    assert judged(Energy(at_most=20.0, joints=("*_right_*",)), MOVED).measured == 0.0
