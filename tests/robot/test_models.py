"""From what a scenario names to a robot model."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.errors import ModelError
from sim_action.core.workspace import Workspace
from sim_action.robot.loading import BUILT_IN, load_model
from sim_action.robot.spec import Robot

URDF = """\
<robot name="box">
  <link name="base">
    <inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
  </link>
</robot>
"""


@pytest.mark.parametrize("name", sorted(BUILT_IN))
def test_a_built_in_model_is_named_without_a_path(name: str, tmp_path: Path) -> None:
    assert load_model(Robot(model=name), Workspace(tmp_path, tmp_path)).name == name


SDF = """\
<sdf version="1.9">
  <model name="box">
    <link name="base">
      <inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>
    </link>
  </model>
</sdf>
"""


@pytest.mark.parametrize("name", ["box.sdf", "box.world", "box.urdf"])
def test_sdf_is_known_by_what_is_in_the_file(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(SDF)
    assert load_model(Robot(model=name), Workspace(tmp_path, tmp_path)).root == "base"


def test_sdf_is_made_by_xacro(tmp_path: Path) -> None:
    made = SDF.replace("<sdf", '<sdf xmlns:xacro="http://www.ros.org/wiki/xacro"').replace(
        "<mass>1", '<xacro:arg name="mass" default="1"/><mass>$(arg mass)'
    )
    (tmp_path / "box.sdf.xacro").write_text(made)
    robot = Robot(model="box.sdf.xacro", args={"mass": 2.5})
    assert load_model(robot, Workspace(tmp_path, tmp_path)).mass == 2.5


def test_a_file_of_the_workspace_is_read(tmp_path: Path) -> None:
    (tmp_path / "box.urdf").write_text(URDF)
    assert load_model(Robot(model="box.urdf"), Workspace(tmp_path, tmp_path)).source == str(tmp_path / "box.urdf")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("turtlebot3", "unknown robot 'turtlebot3'; did you mean 'turtlebot3_burger'?"),
        ("zzz", "unknown robot 'zzz' (allowed: turtlebot3_burger), or the path of a .urdf, .xacro, .sdf or .xml file"),
        ("package://a/b.urdf", "refers to the package 'a', which is not there"),
        ("absent.xacro", "'absent.xacro' does not exist"),
        ("absent.urdf", "'absent.urdf' does not exist"),
        ("../box.urdf", "is outside the workspace"),
        (".", "'.' is a folder"),
        ("a\0.urdf", "cannot be a file"),
        ("model://absent", "refers to the model 'absent', which is not there"),
        ("model://", "names no file"),
        ("ant.xml", "a robot is one body with what hangs on it, this has 0 bodies in its world"),
        ("robot.sdf", "a URDF begins with <robot>, this file with <model>"),
    ],
)
def test_what_is_no_model_is_told_with_what_would_be(name: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "ant.xml").write_text("<mujoco/>")
    (tmp_path / "robot.sdf").write_text("<model/>")
    with pytest.raises(ModelError) as raised:
        load_model(Robot(model=name), Workspace(tmp_path, tmp_path))
    assert message in str(raised.value)


def test_of_many_findings_the_first_of_each_rule_are_notes(tmp_path: Path) -> None:
    tags = '<gazebo reference="nope"/>' * 5_000
    link = '<link name="l"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    (tmp_path / "robot.urdf").write_text(f'<robot name="r">{link}</inertial></link>\n{tags}</robot>')
    model = load_model(Robot(model="robot.urdf"), Workspace(tmp_path, tmp_path))
    of_rule = [finding for finding in model.findings if finding.rule == "unknown-reference"]
    assert len(of_rule) == 101
    assert of_rule[-1].message.startswith("4,900 more problems like these")
    assert (of_rule[-1].level, of_rule[-1].location.line) == ("warning", 2)
    assert [finding.rule for finding in model.findings].count("no-collision-shape") == 1
