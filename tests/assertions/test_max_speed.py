"""The robot is never faster."""

from __future__ import annotations

import math

import pytest
from pydantic import ValidationError

from sim_action.assertions.max_speed import MaxSpeed
from sim_action.state.verdict import Verdict
from tests.traces import judged, trace

FASTER = trace([1.0, 2.0, 3.0], speed=[0.25, -0.5, 0.75], turn_rate=[0.0, -2.0, 1.0])


def test_a_speed_within_the_limit_passes() -> None:
    assert judged(MaxSpeed(linear=1.0), FASTER) == Verdict(
        True, 0.75, 1.0, 0.25, "m/s", 3.0, "moved with at most 0.75 m/s, limit 1 m/s"
    )


def test_backwards_is_a_speed_too() -> None:
    assert judged(MaxSpeed(linear=0.25), FASTER) == Verdict(
        False, 0.5, 0.25, -0.25, "m/s", 2.0, "moved with 0.5 m/s at 2.00 s, more than 0.25 m/s"
    )


def test_turning_has_a_limit_of_its_own() -> None:
    assert judged(MaxSpeed(angular=1.0), FASTER) == Verdict(
        False, 2.0, 1.0, -1.0, "rad/s", 2.0, "turned with 114.6 deg/s at 2.00 s, more than 57.3 deg/s"
    )


@pytest.mark.parametrize(
    ("linear", "angular", "unit", "time"),
    [(1.0, 3.0, "m/s", 3.0), (1.0, 1.0, "rad/s", 2.0), (0.3, 3.0, "m/s", 2.0), (0.6, 1.0, "rad/s", 2.0)],
)
def test_of_both_limits_the_one_that_was_broken_first_speaks(
    linear: float, angular: float, unit: str, time: float
) -> None:
    verdict = judged(MaxSpeed(linear=linear, angular=angular), FASTER)
    assert (verdict.unit, verdict.time) == (unit, time)


def test_standing_still_can_be_asked_for() -> None:
    assert judged(MaxSpeed(linear=0.0), trace([1.0])).passed


@pytest.mark.parametrize(
    ("spec", "title"),
    [
        (MaxSpeed(linear=0.5), "max_speed 0.5 m/s"),
        (MaxSpeed(linear=0.5, angular=math.pi), "max_speed 0.5 m/s, 180 deg/s"),
    ],
)
def test_the_title_says_what_is_asked(spec: MaxSpeed, title: str) -> None:
    assert spec.title == title


@pytest.mark.parametrize("spec", [{}, {"linear": -1}, {"linear": "1 deg/s"}, {"angular": "1 m/s"}])
def test_limits_that_are_none_are_refused(spec: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        MaxSpeed.model_validate(spec)


@pytest.mark.parametrize(("linear", "angular", "unit"), [(1.0, 2.1, "rad/s"), (0.8, 4.0, "m/s"), (100.0, 2.5, "rad/s")])
def test_of_two_limits_that_hold_the_tighter_one_speaks(linear: float, angular: float, unit: str) -> None:
    verdict = judged(MaxSpeed(linear=linear, angular=angular), FASTER)
    assert verdict.passed
    assert verdict.unit == unit
