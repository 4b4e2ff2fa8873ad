"""Like is compared with like."""

from __future__ import annotations

import dataclasses

import pytest

from sim_action.assertions.temporal_logic.formula import Comparison
from sim_action.assertions.temporal_logic.formula_signals import dimension_problems, margin_unit
from sim_action.assertions.temporal_logic.parser import parse
from tests.traces import burger

MODEL = burger()
SLIDERS = tuple(dataclasses.replace(joint, type="prismatic") for joint in MODEL.joints)
SLIDING = dataclasses.replace(MODEL, joints=SLIDERS)


@pytest.mark.parametrize(
    ("text", "si"),
    [
        ("speed < 1 km/h", "m/s"),
        ("1 < speed", "m/s"),
        ("2 * abs(-x) - 1 > y", "m"),
        ("speed * 2 s < x", "m"),
        ("turn_rate * 0.033 m < speed", ""),  # m rad/s, which has no symbol
        ("speed < turn_rate * 0.033 m", "m/s"),
        ("position(wheel_left_joint) < 90 deg", "rad"),
        ("velocity(wheel_left_joint) < 60 rpm", "rad/s"),
        ("effort(wheel_left_joint) < 1 N m", "N m"),
        ("x * x < 2", ""),
        ("tool0.z < 2 m", "m"),
        ("abs(tool0.yaw - yaw) < 5 deg", "rad"),
        ("tool0.speed < 2 * speed", "m/s"),
        ("distance(a, b) < clearance + 1 m", "m"),
        ("force(box) < 2 N", "N"),
        ("imu.linear_acceleration_xyz.norm < 20 m/s^2", "m/s^2"),
        ("bumper.touching > 0.5", ""),
    ],
)
def test_the_unit_of_a_margin(text: str, si: str) -> None:
    formula = parse(text)
    assert isinstance(formula, Comparison)
    assert list(dimension_problems(formula, MODEL)) == []
    assert margin_unit(formula, MODEL) == si


def test_a_joint_that_slides_is_measured_in_metres_and_newtons() -> None:
    formula = parse("position(wheel_left_joint) < 5 cm and effort(wheel_left_joint) < 1 kN")
    assert list(dimension_problems(formula, SLIDING)) == []
    assert len(list(dimension_problems(formula, MODEL))) == 2


def test_every_problem_has_its_place() -> None:
    text = "always (speed < 1 m and x < 1 m) or tilt * tilt < 3 s"
    found = list(dimension_problems(parse(text), MODEL))
    assert [at for at, _ in found] == [text.index("speed"), text.index("tilt")]
    assert found[1][1] == "'tilt * tilt' is in rad^2, '3 s' in s: they cannot be compared"
    # Joints come first.
    ((at, message),) = dimension_problems(parse("speed < 1 m and position(elbow) < 1"), MODEL)
    assert at == 16
    assert message.startswith("the model has no moving joint 'elbow'")


def test_signals_of_links_and_sensors_have_dimensions() -> None:
    text = "tool0.z < 1 deg or force(box) < clearance or scan.ranges.min < 1 s or bumper.touching < x"
    messages = [message for _, message in dimension_problems(parse(text), MODEL)]
    assert messages == [
        "'tool0.z' is in m, '1 deg' in rad: they cannot be compared",
        "'force(box)' is in N, 'clearance' in m: they cannot be compared",
        "'scan.ranges.min' is in m, '1 s' in s: they cannot be compared",
        "'bumper.touching' is in plain numbers, 'x' in m: they cannot be compared",
    ]
