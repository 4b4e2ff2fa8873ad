"""What the motors exert."""

from __future__ import annotations

import math

import pytest

from sim_action.assertions.effort import Effort
from sim_action.assertions.monitors import State
from sim_action.state.verdict import Verdict
from tests.traces import WHEELS, judged, monitor, scene, trace

WHEEL = WHEELS[0]
SEEN = trace([1.0, 2.0, 3.0, 4.0], effort=[3.0, -4.0, 0.0, 5.0])


def test_both_directions_count() -> None:
    assert judged(Effort(at_most=3.5), SEEN) == Verdict(
        False, 4.0, 3.5, -0.5, "N m", 2.0, f"{WHEEL} exerted 4 N m at 2.00 s, more than 3.5 N m", joint=WHEEL
    )
    assert judged(Effort(at_most=6.0), SEEN) == Verdict(
        True, 5.0, 6.0, 1.0, "N m", 4.0, f"{WHEEL} exerted at most 5 N m, limit 6 N m", joint=WHEEL
    )


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


def test_of_both_limits_the_one_that_is_broken_speaks() -> None:
    assert "RMS" in judged(Effort(at_most=6.0, rms_at_most=3.0), SEEN).message
    assert "RMS" not in judged(Effort(at_most=4.5, rms_at_most=4.0), SEEN).message


def test_joints_may_be_named() -> None:
    assert judged(Effort(joints=("*_right_*",), at_most=1.0), SEEN).passed
    assert not judged(Effort(joints=(WHEEL,), at_most=1.0), SEEN).passed


def test_a_limit_in_the_unit_of_another_kind_of_joint_is_a_problem() -> None:
    ((path, message),) = Effort(at_most="5 N").problems(scene())
    assert path == ("at_most",)
    assert message.startswith(f"joint '{WHEEL}' turns: 'N' is not a unit of torque")
    assert message.endswith("; select joints of one kind with 'joints'")
    ((path, message),) = Effort(joints=("elbow",), at_most=5).problems(scene())
    assert path == ("joints", 0)
