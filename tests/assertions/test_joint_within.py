"""Joints stay between bounds."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from sim_action.assertions.joint import JointWithin
from sim_action.state.verdict import Verdict
from tests.traces import WHEELS, judged, scene, trace

WHEEL = WHEELS[0]
SEEN = trace([1.0, 2.0, 3.0], position=[0.5, 1.25, 1.0], velocity=[0.5, -1.0, 0.0], effort=[3.0, 4.0, 2.0])


def within(**readings: dict[str, tuple[float | str, float | str]]) -> JointWithin:
    return JointWithin.model_validate(readings)


def test_the_bound_that_was_nearest_speaks_if_all_hold() -> None:
    assert judged(within(position={WHEEL: (0, 2)}), SEEN) == Verdict(
        True,
        0.5,
        0.0,
        0.5,
        "rad",
        1.0,
        "stayed within; nearest to wheel_left_joint = 0 deg with wheel_left_joint = 28.65 deg at 1.00 s",
    )


def test_a_bound_that_was_left_speaks() -> None:
    assert judged(within(position={WHEEL: (-10, 10)}, velocity={WHEEL: (-0.5, 10)}), SEEN) == Verdict(
        False,
        -1.0,
        -0.5,
        -0.5,
        "rad/s",
        2.0,
        "left past wheel_left_joint velocity = -28.65 deg/s: wheel_left_joint velocity = -57.3 deg/s at 2.00 s",
    )


def test_nearness_is_a_part_of_the_interval() -> None:
    # 1 N m of 100 is nearer to its bound than 0.75 rad of 2.
    verdict = judged(within(position={WHEEL: (0, 2)}, effort={WHEEL: (-95, 5)}), SEEN)
    assert (verdict.unit, verdict.measured, verdict.margin) == ("N m", 4.0, 1.0)


def test_a_pattern_is_of_every_joint_that_it_fits() -> None:
    assert not judged(within(effort={"*": (0, 3.5)}), SEEN).passed
    assert not judged(within(effort={"*_right_*": (1, 5)}), SEEN).passed
    assert judged(within(effort={"*_right_*": (0, 5)}), SEEN).passed


def test_bounds_are_part_of_the_interval_and_take_units() -> None:
    assert judged(within(velocity={WHEEL: ("-1 rad/s", "0.5 rad/s")}), SEEN).margin == 0.0


def test_it_needs_a_moment() -> None:
    assert judged(within(position={WHEEL: (0, 1)}), trace([])).message == "no moment to measure"


@pytest.mark.parametrize(
    ("readings", "message"),
    [
        ({}, "give at least one joint in 'position', 'velocity' or 'effort'"),
        ({"position": {}}, "give at least one joint"),
        ({"position": {WHEEL: ("90 deg", "1 deg")}}, "wrong way round: 90 deg is not below 1 deg"),
        ({"position": {WHEEL: ("0 rad", "1 N")}}, "'N' is not a unit of angle or length"),
        ({"velocity": {WHEEL: 1}}, "valid tuple"),
    ],
)
def test_what_bounds_nothing_is_refused(readings: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        JointWithin.model_validate(readings)


def test_joints_that_are_not_there_and_units_of_others_are_problems() -> None:
    problems = dict(within(position={"elbow": (0, 1), WHEEL: (0, "5 cm")}).problems(scene()))
    assert problems["position", "elbow"].startswith("the model has no moving joint 'elbow'")
    assert problems["position", WHEEL, 1].startswith(f"joint '{WHEEL}' turns: 'cm' is not a unit of angle")


def test_the_title_says_what_is_asked() -> None:
    spec = within(position={"elbow": ("0 deg", "90 deg")}, effort={"*": (-1, 1.5)})
    assert spec.title == "joint_within elbow position 0 deg to 90 deg, * effort -1 to 1.5"
