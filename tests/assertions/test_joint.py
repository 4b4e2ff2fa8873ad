"""What a joint must do."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest

from sim_action.assertions.joint import JointReading, JointWithin
from sim_action.state.verdict import Verdict
from tests.traces import burger, judged, monitor, scene, trace

WHEEL = "wheel_left_joint"
SEEN = trace([1.0, 2.0, 3.0], position=[0.5, 1.25, 1.0], velocity=[0.5, -1.0, 0.0], effort=[3.0, 4.0, 2.0])


def test_a_bound_that_is_reached_not_reached_or_exceeded() -> None:
    message = "wheel_left_joint had position 71.62 deg in 2.00 s"
    verdict = judged(JointReading(name=WHEEL, at_least=1.0), SEEN)
    assert verdict == Verdict(True, 1.25, 1.0, 0.25, "rad", 2.0, message, joint=WHEEL)
    # One that is not.
    verdict = judged(JointReading(name=WHEEL, reading="velocity", at_least=1.0), SEEN)
    assert (verdict.passed, verdict.measured, verdict.margin, verdict.time) == (False, 0.5, -0.5, 1.0)
    assert verdict.message == "wheel_left_joint had velocity 28.65 deg/s of 57.3 deg/s in 3.0 s"
    # One that is exceeded.
    message = "wheel_left_joint had effort 4 N m at 2.00 s, more than 3.5 N m"
    verdict = judged(JointReading(name=WHEEL, reading="effort", at_most=3.5), SEEN)
    assert verdict == Verdict(False, 4.0, 3.5, -0.5, "N m", 2.0, message, joint=WHEEL)


def test_a_value_that_is_come_near_to_or_not() -> None:
    message = "wheel_left_joint came within 14.32 deg of 85.94 deg in 2.00 s"
    verdict = judged(JointReading(name=WHEEL, near=1.5, tolerance=0.5), SEEN)
    assert verdict == Verdict(True, 0.25, 0.5, 0.25, "rad", 2.0, message, joint=WHEEL)
    verdict = judged(JointReading(name=WHEEL, near=1.5, tolerance=0.125), SEEN)
    assert (verdict.passed, verdict.measured, verdict.limit, verdict.margin) == (False, 0.25, 0.125, -0.125)
    message = "wheel_left_joint came no closer than 14.32 deg to 85.94 deg in 3.0 s; closest at 2.00 s"
    assert verdict.message == message


@pytest.mark.parametrize(
    ("off", "is_there"), [(-1.85e-5, True), (0.0, True), (1.29e-8, True), (9e-5, True), (-2e-4, False), (2e-4, False)]
)
@pytest.mark.parametrize("reading", ["position", "velocity"])
def test_a_joint_that_engines_stop_at_its_own_limit_is_at_it(off: float, is_there: bool, reading: Any) -> None:
    model = burger()
    joints = tuple(dataclasses.replace(joint, type="revolute", lower=-1.0, upper=1.0) for joint in model.joints)
    limited = scene(dataclasses.replace(model, joints=joints))
    at: dict[str, Any] = {reading: [1.0 + off]}
    seen = trace([1.0], **at)
    found = {
        "at_least": JointReading(name=WHEEL, reading=reading, at_least=1.0),
        "at_most": JointReading(name=WHEEL, reading=reading, at_most=1.0),
        "within": JointWithin.model_validate({reading: {WHEEL: (-9.0, 1.0)}}),
    }
    passed = {name: monitor(spec, where=limited).observe(seen).verdict().passed for name, spec in found.items()}
    is_there = is_there and reading == "position"
    assert passed == {"at_least": is_there or off >= 0, "at_most": is_there or off <= 0, "within": is_there or off <= 0}


def test_a_joint_that_slides_is_measured_in_metres() -> None:
    model = burger()
    joints = tuple(dataclasses.replace(joint, type="prismatic") for joint in model.joints)
    slider = scene(dataclasses.replace(model, joints=joints))
    seen = monitor(JointReading(name=WHEEL, at_most=2.0), where=slider).observe(SEEN)
    assert seen.verdict().message == "wheel_left_joint had position at most 1.25 m, limit 2 m"


def test_a_joint_that_is_not_there_is_a_problem() -> None:
    ((path, message),) = JointReading(name="wheel_left", at_most=1).problems(scene())
    assert path == ("name",)
    assert message == (
        "the model has no moving joint 'wheel_left'; did you mean 'wheel_left_joint'? "
        "(allowed: wheel_left_joint, wheel_right_joint)"
    )
    # A fixed joint cannot be read.
    assert list(JointReading(name="scan_joint", at_most=1).problems(scene()))


@pytest.mark.parametrize(
    ("spec", "value"),
    [
        ({"at_least": "90 deg"}, math.pi / 2),
        ({"reading": "velocity", "at_least": "60 rpm"}, 2 * math.pi),
        ({"reading": "effort", "at_least": "2 Nm"}, 2.0),
        ({"reading": "effort", "at_least": -2}, -2.0),
    ],
)
def test_each_reading_has_its_units(spec: dict[str, Any], value: float) -> None:
    verdict = judged(JointReading.model_validate({"name": WHEEL, **spec}), SEEN)
    assert verdict.limit == pytest.approx(value)


def test_a_length_is_no_position_of_a_joint_that_turns() -> None:
    (problem,) = JointReading(name=WHEEL, near="5 cm", tolerance="1 deg").problems(scene())
    assert problem == (("near",), "'cm' is not a unit of angle; use one of: rad, deg")


@pytest.mark.parametrize(
    ("spec", "key"),
    [
        ({"at_least": 0.55}, "at_least"),
        ({"near": 0.6, "tolerance": 0.05}, "near"),
        ({"near": -0.3, "tolerance": 0.05}, "near"),
        ({"at_least": 0.5}, ""),
        ({"at_least": -3.0}, ""),
        ({"at_most": 0.7}, ""),
        ({"near": 0.6, "tolerance": 0.1}, ""),
        ({"reading": "velocity", "at_least": 5.0}, ""),
    ],
)
def test_a_goal_beyond_the_limits_of_a_joint_is_a_problem(spec: dict[str, Any], key: str) -> None:
    model = burger()
    joints = tuple(dataclasses.replace(joint, type="revolute", lower=-0.2, upper=0.5) for joint in model.joints)
    where = scene(dataclasses.replace(model, joints=joints))
    problems = list(JointReading(name=WHEEL, **spec).problems(where))
    assert [path for path, _ in problems] == ([(key,)] if key else [])
    assert all("is outside the limits of the joint, -11.46 deg to 28.65 deg" in message for _, message in problems)


def test_a_miss_by_a_hair_is_told_apart_from_the_tolerance() -> None:
    spec = JointReading(name=WHEEL, reading="effort", near=1.0, tolerance=0.1)
    verdict = judged(spec, trace([1.0], effort=[1.10001]))
    assert verdict.message.startswith(f"{WHEEL} came no closer than 0.10001 N m to 1 N m ")


def within(**readings: dict[str, tuple[float | str, float | str]]) -> JointWithin:
    return JointWithin.model_validate(readings)


def test_the_bound_that_was_left_speaks_and_that_was_nearest_if_all_hold() -> None:
    message = "stayed within bounds; closest to wheel_left_joint = 0 deg with wheel_left_joint = 28.65 deg at 1.00 s"
    verdict = judged(within(position={WHEEL: (0, 2)}), SEEN)
    assert verdict == Verdict(True, 0.5, 0.0, 0.5, "rad", 1.0, message, joint=WHEEL)
    message = f"crossed the bound {WHEEL} velocity = -28.65 deg/s: {WHEEL} velocity = -57.3 deg/s at 2.00 s"
    verdict = judged(within(position={WHEEL: (-10, 10)}, velocity={WHEEL: (-0.5, 10)}), SEEN)
    assert verdict == Verdict(False, -1.0, -0.5, -0.5, "rad/s", 2.0, message, joint=WHEEL)


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


def test_joints_that_are_not_there_and_units_of_others_are_problems() -> None:
    problems = dict(within(position={"elbow": (0, 1), WHEEL: (0, "5 cm")}).problems(scene()))
    assert problems["position", "elbow"].startswith("the model has no moving joint 'elbow'")
    assert problems["position", WHEEL, 1].startswith(f"joint '{WHEEL}' turns: 'cm' is not a unit of angle")
