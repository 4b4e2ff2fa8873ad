from __future__ import annotations

import json
from pathlib import Path

import pytest

from sim_action.errors import RefusedModel
from sim_action.inspection import inspect_model
from sim_action.inspection_text import inspection_text
from sim_action.workspace import Workspace
from tests.models.bad_models import GOOD

MESH = '<mesh filename="part.obj"/>'


def workspace(folder: Path, text: str = GOOD) -> Workspace:
    (folder / "robot.urdf").write_text(text, encoding="utf-8")
    return Workspace(folder, folder)


def test_the_burger_is_what_is_published(tmp_path: Path) -> None:
    found = inspect_model("turtlebot3_burger", workspace(tmp_path))
    assert found.mass == pytest.approx(1.002)
    assert found.height == pytest.approx(0.0, abs=1e-9)
    assert found.lower_xyz is not None
    assert found.upper_xyz is not None
    # ROBOTIS's e-Manual: 138 x 178 x 192 mm; wheels alone are 16 mm narrower than its mounted width.
    assert found.upper_xyz[0] - found.lower_xyz[0] == pytest.approx(0.138, abs=0.01)
    assert found.upper_xyz[2] - found.lower_xyz[2] == pytest.approx(0.192, abs=0.01)
    assert found.drive is not None
    assert "radius 0.033 m, separation 0.16 m" in found.drive
    assert found.robot == (
        "robot:\n  model: turtlebot3_burger\n  drive: {diff: {left: [wheel_left_joint], right: [wheel_right_joint]}}\n"
    )


def test_joints_are_a_tree_for_people_and_a_list_for_programs(tmp_path: Path) -> None:
    found = inspect_model("robot.urdf", workspace(tmp_path))
    assert "base (2 kg)\n`- shoulder [revolute about 0 0 1, -57.3 deg to 114.6 deg] -> upper (1 kg)" in (
        inspection_text(found)
    )
    (joint,) = json.loads(found.model_dump_json())["joints"]
    assert (joint["name"], joint["lower"], joint["upper"], joint["axis_xyz"]) == ("shoulder", -1, 2, [0, 0, 1])


def test_the_box_is_around_the_shapes_where_the_joints_put_them(tmp_path: Path) -> None:
    found = inspect_model("robot.urdf", workspace(tmp_path))
    assert (found.lower_xyz, found.upper_xyz) == ((0.5, 1.5, 2.5), (1.5, 2.5, 3.5))
    assert found.height == -2.5


def test_a_joint_says_whom_it_follows(tmp_path: Path) -> None:
    finger = (
        '<link name="finger"/><joint name="bend" type="continuous"><parent link="upper"/><child link="finger"/>'
        '<mimic joint="shoulder"/></joint></robot>'
    )
    found = inspect_model("robot.urdf", workspace(tmp_path, GOOD.replace("</robot>", finger)))
    assert [joint.mimics for joint in found.joints] == [None, "shoulder"]
    assert "bend [continuous about 1 0 0, follows shoulder]" in inspection_text(found)


def test_the_block_holds_what_gazebos_plugin_says(tmp_path: Path) -> None:
    plugin = (
        '<gazebo><plugin filename="libgazebo_ros_diff_drive.so"><leftJoint>l</leftJoint><rightJoint>r</rightJoint>'
        "<wheelSeparation>0.25</wheelSeparation><wheelDiameter>0.1</wheelDiameter></plugin></gazebo></robot>"
    )
    wheels = "".join(
        f'<link name="{side}w"/>'
        f'<joint name="{side}" type="continuous"><parent link="base"/><child link="{side}w"/></joint>'
        for side in "lr"
    )
    found = inspect_model("robot.urdf", workspace(tmp_path, GOOD.replace("</robot>", f"{wheels}{plugin}")))
    assert "drive: {diff: {left: [l], right: [r], radius: 0.05, separation: 0.25}}" in found.robot


def test_nothing_is_said_of_a_size_that_is_not_known(tmp_path: Path) -> None:
    (tmp_path / "part.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n")
    found = inspect_model("robot.urdf", workspace(tmp_path, GOOD.replace('<sphere radius="0.5"/>', MESH)))
    assert (found.lower_xyz, found.upper_xyz, found.height) == (None, None, None)
    assert "above the ground" not in inspection_text(found)


def test_what_a_scenario_has_to_allow_stands_in_the_block(tmp_path: Path) -> None:
    found = inspect_model("robot.urdf", workspace(tmp_path, GOOD.replace('lower="-1" upper="2" ', "")))
    assert found.needs == ("missing-limits",)
    assert "  allow: [missing-limits]\n" in found.robot
    assert "error: " in inspection_text(found)


def test_what_no_engine_could_take_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RefusedModel, match=r"two-parents|one-root|loop"):
        inspect_model(
            "robot.urdf", workspace(tmp_path, GOOD.replace('<parent link="base"/>', '<parent link="upper"/>'))
        )


def test_names_of_a_model_act_nowhere(tmp_path: Path) -> None:
    text = inspection_text(
        inspect_model("robot.urdf", workspace(tmp_path, GOOD.replace('"arm"', '"::error::x ##[a]"')))
    )
    assert not any(line.startswith("::") for line in text.splitlines())
    assert "##[" not in text
