"""Joints with several motions in a URDF: the joints in series and massless links that replace them."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from sim_action.drives.wheels import held_joints
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_model import RobotModel
from sim_action.robot.reading.urdf import read_urdf
from tests.robot.bad_models import GOOD
from tests.ros_workspace import written

_LIMIT = '<limit lower="-1" upper="2" effort="10" velocity="3"/>'


def read(folder: Path, kind: str, more: str = "", axis: str = "0 0 2") -> RobotModel:
    text = GOOD.replace("revolute", kind).replace(_LIMIT, more).replace("0 0 2", axis)
    model = read_urdf(written(folder / "robot.urdf", text))
    assert model.findings == ()
    return model


def test_a_planar_joint_is_two_slides_and_a_hinge(tmp_path: Path) -> None:
    model = read(tmp_path, "planar")
    assert [(part.name, part.type, part.axis_xyz) for part in model.joints] == [
        ("shoulder_x", "prismatic", (1, 0, 0)),
        ("shoulder_y", "prismatic", (0, 1, 0)),
        ("shoulder_turn", "continuous", (0, 0, 1)),
    ]
    assert {part.series for part in model.joints} == {"shoulder"}
    assert held_joints(model) == frozenset()
    assert model.mass == 3
    masses = {link.attrib["name"]: link.find("inertial/mass") for link in ET.fromstring(model.urdf).iter("link")}
    assert {name: mass.get("value") for name, mass in masses.items() if mass is not None} == {
        "base": "2.0",
        "upper": "1.0",
        "shoulder_x": "0.0",
        "shoulder_y": "0.0",
    }
    at = link_poses(model, {"shoulder_x": 1.0, "shoulder_y": 2.0, "shoulder_turn": 0.5})["upper"]
    assert at.position_xyz == pytest.approx((1, 2, 1))
    dampings = [joint.get("damping") for joint in ET.fromstring(model.urdf).iterfind("joint/dynamics")]
    assert dampings == ["0.1"] * 3


@pytest.mark.parametrize(
    ("axis", "first", "second"),
    [("3 0 0", (0, 1, 0), (0, 0, 1)), ("0 1 0", (0, 0, 1), (1, 0, 0)), ("0 0 -1", (1, 0, 0), (0, -1, 0))],
)
def test_the_slides_of_a_planar_joint_are_normal_to_its_axis(
    axis: str, first: tuple[float, ...], second: tuple[float, ...], tmp_path: Path
) -> None:
    slides = read(tmp_path, "planar", axis=axis).joints[:2]
    assert [slide.axis_xyz for slide in slides] == [pytest.approx(first), pytest.approx(second)]


def test_a_universal_joint_has_limits_for_each_axis(tmp_path: Path) -> None:
    model = read(tmp_path, "universal", '<limit lower="-1" upper="1"/><axis2 xyz="0 1 0"/><limit2 effort="3"/>')
    first, second = model.joints
    assert (first.name, first.type, first.lower, first.upper) == ("shoulder_1", "revolute", -1, 1)
    assert (second.name, second.type, second.lower, second.max_effort) == ("shoulder_2", "continuous", None, 3)
    assert held_joints(model) == frozenset()


def test_a_floating_joint_below_the_base_is_three_slides_and_a_ball_joint(tmp_path: Path) -> None:
    model = read(tmp_path, "floating")
    slides = [f"shoulder_slide_{axis}" for axis in "xyz"]
    assert [part.name for part in model.joints] == [*slides, "shoulder_x", "shoulder_y", "shoulder_z"]
    assert [link.name for link in model.links if link.mass is None] == [*slides, "shoulder_x", "shoulder_y"]
    assert model.balls == ("shoulder",)
