"""The robot comes to a point, and may have to face somewhere there."""

from __future__ import annotations

import math

import pytest

from sim_action.assertions.reach import Reach
from sim_action.state.verdict import Verdict
from tests.traces import judged, trace

PAST = trace([1.0, 2.0, 3.0], x=[0.0, 1.75, 3.0], z=[0.5, 0.5, 0.5], yaw=[0.0, 0.5, 1.0])


def test_a_point_is_reached_within_its_tolerance() -> None:
    assert judged(Reach(x=2.0, y=0.0, tolerance=0.5), PAST) == Verdict(
        True, 0.25, 0.5, 0.25, "m", 2.0, "came within 0.25 m of (2, 0) in 2.00 s"
    )


def test_a_point_that_is_missed_says_how_near_and_when() -> None:
    assert judged(Reach(x=2.0, y=0.0, tolerance=0.125), PAST) == Verdict(
        False, 0.25, 0.125, -0.125, "m", 2.0, "came no closer than 0.25 m to (2, 0) in 3.0 s; closest at 2.00 s"
    )


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
    assert verdict.message == (
        "came no closer than 0 m to (1.75, 0), 28.65 deg off its heading, in 3.0 s; closest at 2.00 s"
    )


def test_headings_are_compared_the_short_way_round() -> None:
    turned = trace([1.0], yaw=[math.pi - 0.01])
    assert judged(Reach(x=0.0, y=0.0, yaw=-math.pi + 0.01), turned).passed


def test_the_first_moment_that_is_right_counts() -> None:
    twice = trace([1.0, 2.0], x=[1.04, 1.0])
    assert judged(Reach(x=1.0, y=0.0), twice).time == 1.0


def test_a_miss_by_a_hair_is_told_apart_from_the_tolerance() -> None:
    verdict = judged(Reach(x=0.0, y=0.0), trace([1.0], x=[0.050001]))
    assert verdict.message.startswith("came no closer than 0.050001 m to ")
