"""<ros2_control> and <transmission>, and the controllers in the parameter files that plugins name."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.workspace import Workspace
from sim_action.robot.documents.packages import Packages
from sim_action.robot.model.robot_model import Plugin, RobotModel
from sim_action.robot.reading import control_tags
from sim_action.robot.reading.control_tags import controllers_in
from sim_action.robot.reading.urdf import read_urdf
from tests.ros_workspace import ros_package, written

CONTROL = """
  <ros2_control name="base" type="system">
    <hardware><plugin>gz_ros2_control/GazeboSimSystem</plugin></hardware>
    <joint name="left"><command_interface name="velocity"/><state_interface name="position"/></joint>
    <joint name="passive"><state_interface name="position"/></joint>
  </ros2_control>
"""
TRANSMISSIONS = """
  <transmission name="t"><type>transmission_interface/SimpleTransmission</type>
    <joint name="left"><hardwareInterface>hardware_interface/VelocityJointInterface</hardwareInterface></joint>
    <actuator name="m"/></transmission>
  <transmission name="old"><joint name="right"/><actuator name="m"><hardwareInterface>EffortJointInterface
    </hardwareInterface></actuator></transmission>
"""
PARAMETERS = """
controller_manager:
  ros__parameters:
    update_rate: 30
    base_controller:
      type: diff_drive_controller/DiffDriveController

base_controller:
  ros__parameters:
    left_wheel_names: ["left"]
    right_wheel_names: ["right"]
    wheel_separation: 0.3
    linear.x.max_acceleration: 2.0
    angular: {z: {max_acceleration: 3.0}}
"""
ROS_1 = (
    "base_controller: {type: diff_drive_controller/DiffDriveController, left_wheel_names: [left], "
    "right_wheel_names: [right], wheel_separation: 0.3, linear: {x: {max_acceleration: 2.0}}, "
    "angular.z.max_acceleration: 3.0}"
)
READ = (
    ("type", "diff_drive_controller/DiffDriveController"),
    ("left_wheel_names", "left"),
    ("right_wheel_names", "right"),
    ("wheel_separation", "0.3"),
    ("linear.x.max_acceleration", "2.0"),
    ("angular.z.max_acceleration", "3.0"),
)


def robot(folder: Path, inside: str) -> RobotModel:
    """A robot in a package `demo`, whose root is the workspace."""
    ros_package(folder, "demo")
    inertia = '<mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    base = f'<link name="base"><inertial>{inertia}</inertial></link>'
    path = written(folder / "urdf/robot.urdf", f'<robot name="r">{base}{inside}</robot>')
    return read_urdf(path, Packages(Workspace(folder / "urdf", folder)))


def plugin(*parameters: str, filename: str = "libgazebo_ros2_control.so") -> str:
    tags = "".join(f"<parameters>{reference}</parameters>" for reference in parameters)
    return f'<gazebo><plugin name="gazebo_ros2_control" filename="{filename}">{tags}</plugin></gazebo>'


def test_joints_with_command_interfaces_are_driven(tmp_path: Path) -> None:
    (found,) = robot(tmp_path, CONTROL).commanded
    assert (found.joint, set(found.interfaces), found.tag) == ("left", {"velocity"}, "ros2_control")
    assert found.location.line == 4


def test_joints_with_a_transmission_are_driven(tmp_path: Path) -> None:
    found = robot(tmp_path, TRANSMISSIONS).commanded
    assert [(joint.joint, set(joint.interfaces), joint.tag) for joint in found] == [
        ("left", {"velocity"}, "transmission"),
        ("right", {"effort"}, "transmission"),
    ]


@pytest.mark.parametrize("folder", ["package://demo/config", "$(find demo)/config", "../config"])
@pytest.mark.parametrize(
    "file", ["libgazebo_ros2_control.so", "gz_ros2_control-system", "libign_ros2_control-system.so"]
)
def test_controllers_come_after_the_plugin_that_names_their_file(file: str, folder: str, tmp_path: Path) -> None:
    written(tmp_path / "config/control.yaml", PARAMETERS)
    asked, controller = robot(tmp_path, plugin(f"{folder}/control.yaml", filename=file)).plugins
    assert asked.unread == ()
    assert (controller.name, controller.title) == (READ[0][1], "base_controller")
    assert set(controller.parameters) == set(READ)
    assert controller.location is not None
    assert controller.location.line == 8


@pytest.mark.parametrize(
    ("reference", "reason"),
    [
        ("package://demo/none.yaml", "does not exist"),
        ("/none/at/all.yaml", "outside"),
        ("package://absent/none.yaml", "package 'absent'"),
    ],
)
def test_a_file_that_is_not_found_is_a_reason_and_no_error(reference: str, reason: str, tmp_path: Path) -> None:
    asked, other = robot(tmp_path, plugin(reference) + plugin("none.yaml", filename="libother.so")).plugins
    assert reason in asked.unread[0]
    # Other plugins name no parameter files.
    assert other.unread == ()


@pytest.mark.parametrize(
    "text",
    [
        PARAMETERS,
        PARAMETERS.replace("\nbase_controller:", "\n/robot/base_controller:"),
        "robot:\n" + "".join(f"  {line}\n" for line in PARAMETERS.strip().splitlines()),
        ROS_1,
    ],
    ids=["ROS 2", "with a namespace", "below a namespace", "ROS 1"],
)
def test_controllers_are_found_wherever_their_types_stand(text: str, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(text)
    (controller,) = controllers_in(tmp_path / "a.yaml")
    assert controller.title == "base_controller"
    assert set(controller.parameters) == set(READ)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("a: [", "cannot be read as YAML"),
        ("a: &x [1]\nb: *x\n", "has YAML aliases"),
        ("a: !!python/object:os.system {}", "cannot be read as YAML"),
        ("x" * 1_000_001, "is larger than 1 MB"),
        ("a: 1\nb: " + "[" * 10_000, "line 2: .* 20 levels"),
        ("[" + "1," * 30_000 + "]", "line 1: at most 10,000 values"),
        ("a: 1\n---\nb: 1\n---\nc: 1", "one document"),
        ("? " + "k" * 1_000 + "\n: 1", "a key must be a text of at most 200 characters"),
        ("? [a]\n: 1", "a key must be a text"),
        ('a: "\\UFFFFFFFF"', "cannot be read as YAML"),
    ],
    ids=["syntax", "aliases", "tags", "size", "levels", "values", "documents", "long key", "list as key", "escape"],
)
def test_files_that_cannot_be_read_say_why(text: str, reason: str, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(ValueError, match=reason):
        controllers_in(tmp_path / "a.yaml")


@pytest.mark.parametrize("text", ["", "[1, 2]", "a: 1", "1: {type: x}", "a: {b: {type: 3}}"])
def test_files_without_controllers_have_none(text: str, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(text)
    assert all("/" not in found.name for found in controllers_in(tmp_path / "a.yaml"))


@pytest.mark.parametrize("value", ["!!bool foo", "!!int foo", "!!float foo", "!!timestamp foo", "2020-99-99", "1e999"])
def test_values_are_texts_whatever_their_tag(value: str, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(f"c: {{type: a/B, x: {value}}}")
    try:
        (controller,) = controllers_in(tmp_path / "a.yaml")
    except ValueError as error:
        assert "a tag is not read" in str(error)  # noqa: PT017 - both are right
    else:
        assert dict(controller.parameters)["x"] == value.rpartition(" ")[2]


def test_values_of_nested_controllers_are_limited_together(tmp_path: Path) -> None:
    start = "".join(f"{'  ' * level}n{level}:\n{'  ' * level}  type: x\n" for level in range(17))
    (tmp_path / "a.yaml").write_text(f"{start}{'  ' * 17}v: [{'1,' * 5_000}]\n")
    assert sum(len(found.parameters) for found in controllers_in(tmp_path / "a.yaml")) == 10_000


def test_each_parameter_file_is_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read = list[Path]()

    def counted(path: Path) -> tuple[Plugin, ...]:
        read.append(path)
        return controllers_in(path)

    monkeypatch.setattr(control_tags, "controllers_in", counted)
    (tmp_path / "a.yaml").write_text(ROS_1)
    names = ("../a.yaml", "package://demo/a.yaml", "../a.yaml")
    found = robot(tmp_path, plugin(*names) + plugin(*names)).plugins
    assert read == [tmp_path / "a.yaml"]
    assert [plugin.title for plugin in found].count("base_controller") == 1


def test_the_parameter_files_of_a_model_are_limited(tmp_path: Path) -> None:
    names = [f"{number}.yaml" for number in range(20)]
    for name in names:
        (tmp_path / name).write_text("")
    (asked,) = robot(tmp_path, plugin(*(f"../{name}" for name in names))).plugins
    assert asked.unread == ("a model has at most 10 of them",)
