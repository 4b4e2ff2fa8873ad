"""Transmissions of descriptions, and messages on joints that lack one."""

from __future__ import annotations

from xml.etree import ElementTree as ET

from sim_action.ros.ros1.ros_control import transmissions_of

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
