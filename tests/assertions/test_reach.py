"""The robot comes to a point, and may have to face somewhere there."""

from __future__ import annotations

import dataclasses
import math

import pytest

from sim_action.assertions.monitors import State
from sim_action.assertions.monitors.windows import Window
from sim_action.assertions.reach import FinalPose, Reach
from sim_action.core.geometry import Pose, multiply, quaternion_from_rpy
from sim_action.simulation.panel import Panel
from sim_action.state.verdict import Verdict
from tests.traces import START, expectation, judged, monitor, scenario, scene, trace

PAST = trace([1.0, 2.0, 3.0], x=[0.0, 1.75, 3.0], z=[0.5, 0.5, 0.5], yaw=[0.0, 0.5, 1.0])


def test_a_point_is_reached_within_its_tolerance_or_missed_by_how_much_and_when() -> None:
    message = "came within 0.25 m of (2, 0) in 2.00 s"
    verdict = judged(Reach(x=2.0, y=0.0, tolerance=0.5), PAST)
    assert verdict == Verdict(True, 0.25, 0.5, 0.25, "m", 2.0, message)
    message = "came no closer than 0.25 m to (2, 0) in 3.0 s; closest at 2.00 s"
    verdict = judged(Reach(x=2.0, y=0.0, tolerance=0.125), PAST)
    assert verdict == Verdict(False, 0.25, 0.125, -0.125, "m", 2.0, message)


def test_height_counts_if_it_is_asked_for() -> None:
    assert judged(Reach(x=1.75, y=0.0, z=0.5), PAST).passed
    assert judged(Reach(x=1.75, y=0.0, z=0.0), PAST).measured == 0.5


def test_a_heading_must_be_right_at_the_same_moment() -> None:
    assert judged(Reach(x=1.75, y=0.0, yaw=0.5), PAST).passed
    verdict = judged(Reach(x=1.75, y=0.0, yaw=1.0), PAST)
    assert not verdict.passed
    assert verdict.time == 2.0
    assert verdict.measured == 0.0
    assert verdict.margin is not None
    # The heading is off by 0.5 rad where 5 degrees are allowed: as a part of the tolerance of 5 cm.
    assert verdict.margin == pytest.approx((math.radians(5) - 0.5) * 0.05 / math.radians(5))
    message = "came no closer than 0 m to (1.75, 0), 28.65 deg off its heading, in 3.0 s; closest at 2.00 s"
    assert verdict.message == message


def test_headings_are_compared_the_short_way_round() -> None:
    turned = trace([1.0], yaw=[math.pi - 0.01])
    assert judged(Reach(x=0.0, y=0.0, yaw=-math.pi + 0.01), turned).passed
    # The first moment that is right counts.
    twice = trace([1.0, 2.0], x=[1.04, 1.0])
    assert judged(Reach(x=1.0, y=0.0), twice).time == 1.0


def test_a_miss_by_a_hair_is_told_apart_from_the_tolerance() -> None:
    missed = trace([1.0], x=[0.050001])
    assert judged(Reach(x=0.0, y=0.0), missed).message.startswith("came no closer than 0.050001 m to ")
    assert "ended 0.050001 m from" in judged(FinalPose(x=0.0), missed).message


def test_the_last_moment_is_judged_and_says_when_it_was_there_or_nearest() -> None:
    message = "ended 0.25 m from (2.75, 0) at 3.00 s"
    verdict = judged(FinalPose(x=2.75, y=0.0, tolerance=0.5), PAST)
    assert verdict == Verdict(True, 0.25, 0.5, 0.25, "m", 3.0, message)
    message = "ended 1.25 m from (1.75, 0) at 3.00 s; it was within tolerance at 2.00 s"
    verdict = judged(FinalPose(x=1.75, y=0.0, tolerance=0.25), PAST)
    assert verdict == Verdict(False, 1.25, 0.25, -1.0, "m", 3.0, message)
    assert judged(FinalPose(x=1.5, y=0.0), PAST).message.endswith("; it was closest at 2.00 s")
    assert judged(FinalPose(x=4.0, y=0.0), PAST).message == "ended 1 m from (4, 0) at 3.00 s"


def test_of_place_and_heading_the_worse_speaks() -> None:
    verdict = judged(FinalPose(x=2.9, y=0.0, yaw=0.5, tolerance=0.2, yaw_tolerance=0.25), PAST)
    assert (verdict.measured, verdict.limit, verdict.margin, verdict.unit) == (0.5, 0.25, -0.25, "rad")
    assert verdict.message.startswith("ended 0.1 m from (2.9, 0), 28.65 deg off its heading at 3.00 s")


def test_a_heading_alone_is_judged_the_short_way_round() -> None:
    turned = trace([1.0], x=[7.0], yaw=[math.pi - 0.01])
    verdict = judged(FinalPose(yaw=-math.pi + 0.01), turned)
    assert verdict.passed
    assert verdict.message == "ended 1.146 deg off its heading at 1.00 s"


def test_an_axis_alone_leaves_the_others_free() -> None:
    assert judged(FinalPose(z=0.5), PAST).passed
    assert judged(FinalPose(y=1.0), PAST).message == "ended 1 m from y = 1 m at 3.00 s"


def test_relative_to_the_start_x_is_ahead_and_y_to_the_left() -> None:
    facing_left = Pose((1.0, 2.0, 0.25), quaternion_from_rpy(0.0, 0.0, math.pi / 2))
    start = dataclasses.replace(START, pose=facing_left)
    gone = trace([1.0], x=[0.5], y=[4.0], z=[0.5], yaw=[math.pi])
    spec = FinalPose(x=2.0, y=0.5, z=0.25, yaw=math.pi / 2, tolerance=1e-9, yaw_tolerance=1e-9, relative=True)
    assert judged(spec, gone, start).passed
    assert not judged(spec.model_copy(update={"y": -0.5}), gone, start).passed


def test_it_neither_ends_a_run_nor_keeps_it_going() -> None:
    for place in (0.0, 9.0):
        assert monitor(FinalPose(x=place)).observe(PAST).state is State.HOLDS
    panel = Panel.open(scenario(expectation(FinalPose(x=9.0)), duration=2.5), scene(), START)
    ended, seen = panel.observe_until_end(PAST)
    assert (ended.end, len(seen), ended.verdicts()[0].passed) == ("duration", 3, False)


def test_before_says_when_it_is_judged() -> None:
    seen = Window(monitor(FinalPose(x=1.75)), before=2.0).observe(PAST)
    assert (seen.verdict().passed, seen.verdict().time) == (True, 2.0)


def test_the_start_orientation_of_a_link_turns_before_the_orientation_asked_for() -> None:
    """A link that is rolled by 90 deg, and turns by 90 deg about the z axis of the world: its y axis looks down -x."""
    rolled = quaternion_from_rpy(math.pi / 2, 0.0, 0.0)
    turned = quaternion_from_rpy(0.0, 0.0, math.pi / 2)
    spec = FinalPose.model_validate({"link": "wrist", "relative": True, "orientation": {"yaw": "90 deg"}})
    angle = spec._angle("wrist", dataclasses.replace(START, pose=Pose(orientation_xyzw=rolled)))
    assert angle is not None
    assert angle.target == pytest.approx(multiply(turned, rolled))
    assert angle.target != pytest.approx(multiply(rolled, turned))
