"""The robot comes to rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest

from sim_action.assertions.monitors import State
from sim_action.assertions.settled import Settled, StopsBefore
from sim_action.scenario.model import DrivenRobot
from sim_action.state.observation import Contact
from sim_action.state.trace import Trace
from sim_action.state.trace_records import ClearanceRecord, Nearness
from sim_action.state.verdict import Verdict
from tests.traces import BURGER, START, contact, judged, monitor, scene, trace

SLOWING = trace([1.0, 2.0, 3.0, 4.0, 5.0], speed=[1.0, 0.25, 0.125, 0.0, 0.0], turn_rate=[0.0, 0.0, 1.0, 0.0, 0.0])


def settled(**keys: Any) -> Settled:
    return Settled.model_validate(keys)


def test_it_says_since_when_it_rests() -> None:
    assert judged(settled(), SLOWING) == Verdict(True, 1.0, 1.0, 0.0, "s", 5.0, "at rest from 4.00 s on, for 1 s")


def test_both_speeds_must_be_slow_at_once_and_an_interruption_of_one_step_begins_it_anew() -> None:
    assert judged(settled(speed=0.25), SLOWING).time == 5.0
    assert judged(settled(speed=0.25, turn_rate=1.0), SLOWING).time == 3.0
    bounced = trace([1.0, 1.5, 2.0, 2.5], speed=[0.0, 0.5, 0.0, 0.0])
    assert judged(settled(), bounced).measured == 0.5


def test_a_rest_that_is_too_short_says_how_long_it_was_and_what_moves() -> None:
    again = trace([1.0, 2.0, 3.0, 4.0], speed=[0.0, 0.0, 0.5, 0.5])
    message = "at rest for 1 s of 1.5 s, from 1.00 s on; at 4.00 s the base moved with 0.5 m/s"
    assert judged(settled(**{"for": "1.5 s"}), again) == Verdict(False, 1.0, 1.5, -0.5, "s", 2.0, message)
    message = "at rest for 1 s of 3 s, from 4.00 s on; at 5.00 s it still was"
    assert judged(settled(**{"for": "3 s"}), SLOWING).message == message
    # What never rests says what moves most as a part of its limit.
    spinning = trace([1.0, 2.0], speed=[0.1, 0.1], turn_rate=[1.0, 1.0])
    assert judged(settled(), spinning).message == "at rest for 0 s of 1 s; at 2.00 s the base turned with 57.3 deg/s"


def test_joints_count_if_asked_for_and_those_of_a_bolted_robot_by_themselves() -> None:
    turning = trace([1.0, 2.0, 3.0], velocity=[-1.0, -1.0, -1.0])
    assert judged(settled(), turning).passed
    verdict = judged(settled(joints=True), turning)
    assert verdict.message == "at rest for 0 s of 1 s; at 3.00 s wheel_left_joint moved with 57.3 deg/s"
    bolted = replace(scene(), robot=DrivenRobot(model=BURGER, base="fixed"))
    assert not settled().monitor(bolted, START).observe(turning).verdict().passed
    assert settled(joints=False).monitor(bolted, START).observe(turning).verdict().passed


def test_a_robot_that_jumps_is_not_at_rest() -> None:
    """A script that sets the pose of the robot again and again moves it without a velocity."""
    seen = trace([step / 240 for step in range(241)], x=[float(step // 24) for step in range(241)])
    verdict = judged(settled(**{"for": 0.5}), seen)
    assert not verdict.passed
    assert verdict.measured == pytest.approx(23 / 240)


def stops(**keys: Any) -> StopsBefore:
    return StopsBefore.model_validate({"body": "wall", "gap": (0.25, 0.5), **keys})


def seen(gaps: Sequence[float], speeds: Sequence[float], contacts: Sequence[Contact] = ()) -> Trace:
    """A second each; the wall's distances as the engine would tell them."""
    spec, times = stops(), [float(second) for second in range(1, len(gaps) + 1)]
    moments = [Nearness(time, gap, "base_scan", "wall") for time, gap in zip(times, gaps, strict=True)]
    near = [moment for moment in moments if moment.distance <= 0.5]
    far = [moment for number, moment in enumerate(moments) if moment.distance < min([9.0, *gaps[:number]])]
    told = {spec.near: ClearanceRecord.of(near), spec.far: ClearanceRecord.of(far)}
    return replace(trace(times, speed=speeds, contacts=contacts), clearances=told)


def test_it_says_where_and_since_when_it_rests() -> None:
    message = "at rest 0.375 m before wall from 3.00 s on"
    verdict = judged(stops(), seen([2.0, 0.75, 0.375, 0.375], [1.0, 1.0, 0.0, 0.0]))
    assert verdict == Verdict(True, 0.375, 0.25, 0.125, "m", 4.0, message)
    # The bound that is nearer is the limit.
    verdict = judged(stops(), seen([0.4375, 0.4375], [0.0, 0.0]))
    assert (verdict.limit, verdict.margin) == (0.5, 0.0625)


def test_a_robot_that_stops_too_early_or_too_late_says_how_near_it_came() -> None:
    message = "at 3.00 s it was at rest, more than 0.5 m before wall; closest was 0.75 m at 2.00 s"
    verdict = judged(stops(), seen([2.0, 0.75, 0.75], [1.0, 0.0, 0.0]))
    assert verdict == Verdict(False, 0.75, 0.5, -0.25, "m", 3.0, message)
    verdict = judged(stops(), seen([0.5, 0.125, 0.125], [1.0, 0.0, 0.0]))
    assert (verdict.measured, verdict.limit, verdict.margin) == (0.125, 0.25, -0.125)
    assert verdict.message == "at 3.00 s it was at rest, 0.125 m before wall, less than 0.25 m"


def test_a_robot_that_drives_by_does_not_stop() -> None:
    verdict = judged(stops(), seen([0.75, 0.375, 0.75], [1.0, 1.0, 1.0]))
    assert (verdict.passed, verdict.margin) == (False, 0.0)
    message = "at 3.00 s it was moving with 1 m/s, more than 0.5 m before wall; closest was 0.375 m at 2.00 s"
    assert verdict.message == message


def test_a_rest_that_is_too_short_says_how_long_it_was() -> None:
    verdict = judged(stops(**{"for": "2 s"}), seen([0.5, 0.375, 0.375], [1.0, 0.0, 0.0]))
    assert (verdict.unit, verdict.measured, verdict.limit, verdict.margin) == ("s", 1.0, 2.0, -1.0)
    assert verdict.message == "at rest for 1 s of 2 s; at 3.00 s it was at rest, 0.375 m before wall"


def test_a_robot_that_spins_is_not_at_rest() -> None:
    spinning = replace(seen([0.375, 0.375], [0.0, 0.0]), state=trace([1.0, 2.0], turn_rate=[1.0, 1.0]).state)
    message = "at rest for 0 s of 1 s; at 2.00 s it was turning with 57.3 deg/s, 0.375 m before wall"
    assert judged(stops(), spinning).message == message


def test_a_touch_breaks_it_before_and_after_its_rest() -> None:
    opened = monitor(stops())
    rested = opened.observe(seen([0.375, 0.375], [0.0, 0.0]))
    assert (opened.state, rested.state) == (State.PENDING, State.HOLDS)
    touched = rested.observe(trace([3.0], contacts=[contact(3.0, "wall", "base_scan")]))
    assert touched.state is State.BROKEN
    message = "base_scan touched wall at 3.00 s"
    assert touched.verdict() == Verdict(False, 0.0, 0.25, -0.25, "m", 3.0, message, body="wall")
    assert rested.observe(trace([3.0], contacts=[contact(3.0, "ball")])).state is State.HOLDS


def test_a_stored_trace_has_fewer_moments_than_distances() -> None:
    sparse = seen([2.0, 0.375, 0.375, 0.375], [1.0, 0.0, 0.0, 0.0]).rows(slice(1, None, 2))
    assert judged(stops(), sparse).measured == 0.375


def test_a_body_that_is_not_there_is_a_problem() -> None:
    ((path, message),) = stops(body="walls").problems(scene())
    assert (path, message[:41]) == (("body",), "the world has no body 'walls'; did you me")


def test_it_needs_a_distance() -> None:
    assert judged(stops(), trace([1.0])).message == "no distance to measure"
