"""Transmissions of descriptions, messages on joints that lack one, and curves of joint trajectories."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.ros.ros1.ros_control import JointCurve, Waypoint, joint_curves, transmissions_of

ROBOT = """
<robot name="arm">
  <transmission name="a"><joint name="elbow">
    <hardwareInterface>hardware_interface/PositionJointInterface</hardwareInterface>
    <hardwareInterface>VelocityJointInterface</hardwareInterface></joint><actuator name="m"/></transmission>
  <transmission name="b"><joint name="wrist"/>
    <actuator name="n"><hardwareInterface>EffortJointInterface</hardwareInterface></actuator></transmission>
</robot>
"""


def test_interfaces_are_named_at_joints_or_at_actuators_with_or_without_a_package() -> None:
    found = transmissions_of(ET.fromstring(ROBOT))

    assert found.interfaces == {
        "elbow": {"hardware_interface/PositionJointInterface", "hardware_interface/VelocityJointInterface"},
        "wrist": {"hardware_interface/EffortJointInterface"},
    }
    assert found.why_not("elbow", "velocity") is None


def test_what_is_missing_is_named() -> None:
    found = transmissions_of(ET.fromstring(ROBOT))

    assert "the controller needs hardware_interface/PositionJointInterface" in (
        found.why_not("wrist", "position") or ""
    )
    assert "did you mean 'wrist'?" in (found.why_not("wrists", "effort") or "")


numbers = st.floats(-3, 3)


def test_without_velocities_it_goes_straight_and_rests_at_both_ends() -> None:
    curve = JointCurve((Waypoint(1.0, 0.0), Waypoint(3.0, 4.0)))

    assert curve.at(0.5) == (0.0, 0.0)
    assert curve.at(2.0) == (2.0, 2.0)
    assert curve.at(9.0) == (4.0, 0.0)


@given(ends=st.tuples(numbers, numbers, numbers, numbers), span=st.floats(0.1, 5), part=st.floats(0.01, 0.99))
def test_with_velocities_it_has_them_at_its_points_and_is_smooth_between(
    ends: tuple[float, float, float, float], span: float, part: float
) -> None:
    first, speed, last, end_speed = ends
    curve = JointCurve((Waypoint(0.0, first, speed), Waypoint(span, last, end_speed)))

    assert curve.at(1e-9) == pytest.approx((first, speed), abs=1e-4)
    assert curve.at(span - 1e-9) == pytest.approx((last, end_speed), abs=1e-4)
    before, after = (curve.at(part * span + step)[0] for step in (-1e-6, 1e-6))
    assert (after - before) / 2e-6 == pytest.approx(curve.at(part * span)[1], abs=1e-3)


def test_each_joint_has_its_own_from_where_it_is() -> None:
    start = [Waypoint(5.0, 0.1, 0.0), Waypoint(5.0, 0.2, 0.0)]
    found = joint_curves(
        ["a", "b"], start, [(5.0, [9.0, 9.0], []), (6.0, [1.0, 2.0], [0.0, 0.0]), (7.0, [1.5, 2.5], [])]
    )

    assert found["b"].at(5.0)[0] == 0.2
    assert found["a"].at(6.0)[0] == 1.0
    assert found["b"].at(6.5) == (2.25, 0.5)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([(4.0, [1.0], [])], "in the past"),
        ([(6.0, [1.0], []), (6.0, [2.0], [])], "do not increase"),
        ([(6.0, [1.0, 2.0], [])], "needs 1 positions"),
        ([(6.0, [1.0], [1.0, 2.0])], "needs 1 positions"),
    ],
)
def test_what_cannot_be(points: list[tuple[float, list[float], list[float]]], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        joint_curves(["a"], [Waypoint(5.0, 0.0)], points)
