"""Plugins of Gazebo and controllers of ros2_control: their names, and the meaning of their parameters."""

from __future__ import annotations

import dataclasses

import pytest

from sim_action.drives import Drive, recognise, why_not_recognised
from sim_action.drives.ackermann import AckermannDrive
from sim_action.drives.diff import DiffDrive
from sim_action.drives.mecanum import MecanumDrive
from sim_action.drives.plugins import kind_of
from sim_action.drives.skid import SkidSteer
from sim_action.robot.model.robot_model import Plugin, RobotModel
from tests.drives.carts import CAR, FOUR, PLACE, RADIUS, STEERED, asking, cart, steered, wheel

TWO = cart(wheel("a", 0.0, 0.3), wheel("b", 0.0, -0.3))
FOURS = cart(*FOUR)
TRICYCLE = cart(wheel("c", 0.0, 0.2), wheel("d", 0.0, -0.2), steered("a", 0.5, 0.0))


@pytest.mark.parametrize(
    ("name", "title", "kind"),
    [
        ("gz-sim-diff-drive-system", "", "diff"),
        ("gz-sim8-diff-drive-system", "", "diff"),
        ("ignition-gazebo-diff-drive-system", "", "diff"),
        ("ignition-gazebo6-mecanum-drive-system", "", "mecanum"),
        ("anything", "gz::sim::systems::DiffDrive", "diff"),
        ("", "ignition::gazebo::systems::AckermannSteering", "ackermann"),
        ("gz-sim-velocity-control-system", "", "mover"),
        ("gazebo_ros_planar_move", "", "mover"),
        ("ridgeback_ros_force_based_move", "", "mover"),
        ("SimpleTrackedVehiclePlugin", "", "tracks"),
        ("gz-sim-track-controller-system", "", "tracks"),
        ("", "gz::sim::systems::TrackedVehicle", "tracks"),
        ("gz-sim-joint-position-controller-system", "", "position joint"),
        ("gz-sim-imu-system", "gz::sim::systems::Imu", None),
        ("gazebo_ros2_control", "", None),
    ],
)
def test_a_plugin_is_known_by_its_file_or_its_class(name: str, title: str, kind: str | None) -> None:
    assert kind_of(Plugin(name, (), title)) == kind


CAR_CONTROLLER = "ackermann_steering_controller/AckermannSteeringController"
CAR_JOINTS = "steering_joints_names=b_steer,a_steer traction_joints_names=d,c"
DIFF_CONTROLLER = "diff_drive_controller/DiffDriveController"
SIDES = "left_wheel_names=a right_wheel_names=b"
MULTIPLIERS = "wheel_separation_multiplier=1.5 left_wheel_radius_multiplier=1.2 right_wheel_radius_multiplier=1.2"
CAR_DRIVE = AckermannDrive(steering=("b_steer", "a_steer"), wheels=("d", "c"))
MECANUM_CONTROLLER = "mecanum_drive_controller/MecanumDriveController"
MECANUM_PLACES = {"front_left": "a", "rear_left": "b", "front_right": "c", "rear_right": "d"}
MECANUM_JOINTS = " ".join(f"{place}_wheel_command_joint_name={joint}" for place, joint in MECANUM_PLACES.items())
# model, plugin, its parameters, and the drive that they state
STATEMENTS: dict[str, tuple[RobotModel, str, str, Drive]] = {
    "Gazebo's diff": (
        *(TWO, "DiffDrivePlugin", "left_joint=a right_joint=b torque=5"),
        DiffDrive(left=("a",), right=("b",), torque=5),
    ),
    "Gazebo's skid": (
        *(FOURS, "SkidSteerDrivePlugin", "left_front=a left_rear=b right_front=c right_rear=d MaxForce=5.0"),
        SkidSteer(left=("a", "b"), right=("c", "d"), torque=5),
    ),
    "wheel pairs": (
        *(FOURS, "gazebo_ros_diff_drive", "num_wheel_pairs=2 left_joint=a right_joint=c left_joint=b right_joint=d"),
        SkidSteer(left=("a", "b"), right=("c", "d")),
    ),
    "diff controller": (
        *(TWO, DIFF_CONTROLLER),
        f"{SIDES} wheel_separation=0.6 wheel_radius=0.1 linear.x.max_acceleration=0.5 {MULTIPLIERS}",
        DiffDrive(left=("a",), right=("b",), separation=0.6 * 1.5, radius=0.1 * 1.2, acceleration=0.5),
    ),
    "diff controller of ROS 1": (
        *(TWO, DIFF_CONTROLLER, "left_wheel=a right_wheel=b wheel_radius=0.1 wheel_radius_multiplier=0.9"),
        DiffDrive(left=("a",), right=("b",), radius=0.1 * 0.9),
    ),
    "ackermann": (
        *(CAR, CAR_CONTROLLER),
        f"{CAR_JOINTS} wheelbase=0.52 traction_wheels_radius=0.11",
        CAR_DRIVE.model_copy(update={"wheelbase": 0.52, "radius": 0.11}),
    ),
    "ackermann of Humble": (
        *(CAR, CAR_CONTROLLER),
        "front_wheels_names=b_steer,a_steer rear_wheels_names=d,c rear_wheels_radius=0.11 front_wheels_radius=0.2",
        CAR_DRIVE.model_copy(update={"radius": 0.11}),
    ),
    "tricycle": (
        *(TRICYCLE, "tricycle_controller/TricycleController"),
        "steering_joint_name=a_steer traction_joint_name=a wheel_radius=0.1",
        AckermannDrive(steering=("a_steer",), wheels=("a",), radius=0.1),
    ),
    "ackermann of ROS 2": (
        *(CAR, "gazebo_ros_ackermann_drive"),
        f"{STEERED} front_left_joint=a rear_left_joint=c rear_right_joint=d max_steer=0.5",
        AckermannDrive(steering=("a_steer", "b_steer"), wheels=("c", "d"), steering_limit=0.5),
    ),
    "mecanum controller": (
        *(FOURS, MECANUM_CONTROLLER),
        f"{MECANUM_JOINTS} kinematics.wheels_radius=0.1",
        MecanumDrive(left=("a", "b"), right=("c", "d"), radius=0.1),
    ),
}


@pytest.mark.parametrize(("robot", "plugin", "parameters", "expected"), STATEMENTS.values(), ids=STATEMENTS)
def test_a_statement_is_read_with_its_figures(robot: RobotModel, plugin: str, parameters: str, expected: Drive) -> None:
    model = asking(robot, plugin, parameters)
    drive = recognise(model)
    assert drive is not None
    assert drive == expected
    assert drive.source(model).endswith("at robot.urdf:7")


def test_a_controller_has_its_name_and_unequal_radii_of_its_sides_are_noted() -> None:
    drive = recognise(named := asking(TWO, DIFF_CONTROLLER, SIDES, title="base_controller"))
    assert drive is not None
    assert drive.source(named) == "controller 'base_controller' at robot.urdf:7"
    model = asking(TWO, DIFF_CONTROLLER, f"{SIDES} wheel_radius=0.1 left_wheel_radius_multiplier=1.1")
    drive = recognise(model)
    assert drive == DiffDrive(left=("a",), right=("b",), radius=0.1)
    assert "corrects the radii of the two sides differently, which is not simulated" in drive.describe(model)


@pytest.mark.parametrize(
    ("robot", "plugin", "parameters", "remark"),
    [
        (TWO, DIFF_CONTROLLER, f"{SIDES} wheel_separation=0.6", None),
        (TWO, DIFF_CONTROLLER, f"{SIDES} wheel_separation=0.62", None),
        (TWO, DIFF_CONTROLLER, f"{SIDES} wheel_separation=0.64", "separation, 0.6 m"),
        (TWO, DIFF_CONTROLLER, f"{SIDES} wheel_radius={1.04 * RADIUS}", None),
        (TWO, DIFF_CONTROLLER, f"{SIDES} wheel_radius={1.1 * RADIUS}", "wheel radius, 0.1 m"),
        (CAR, CAR_CONTROLLER, f"{CAR_JOINTS} wheelbase=0.51", None),
        (CAR, CAR_CONTROLLER, f"{CAR_JOINTS} wheelbase=0.3", "wheelbase, 0.5 m"),
        (CAR, CAR_CONTROLLER, f"{CAR_JOINTS} traction_wheels_radius=0.11", "wheel radius, 0.1 m"),
        (FOURS, MECANUM_CONTROLLER, f"{MECANUM_JOINTS} kinematics.wheels_radius=0.2", "wheel radius, 0.1 m"),
    ],
)
def test_figures_that_differ_from_the_wheels_are_noted(
    robot: RobotModel, plugin: str, parameters: str, remark: str | None
) -> None:
    drive = recognise(model := asking(robot, plugin, parameters))
    assert drive is not None
    text = drive.describe(model)
    assert ("differs from" in text) == (remark is not None)
    if remark is not None:
        title, length = remark.split(", ")
        assert f"the plugin's {title} differs from that of the wheels in the model, {length}" in text


def test_the_effective_separation_of_a_skid_steer_may_be_greater() -> None:
    for separation, differs in ((0.9, False), (0.4, True)):
        sides = "left_front=a left_rear=b right_front=c right_rear=d"
        model = asking(FOURS, "SkidSteerDrivePlugin", f"{sides} wheel_separation={separation}")
        drive = recognise(model)
        assert drive is not None
        assert ("differs from" in drive.describe(model)) == differs


def test_parameter_files_that_are_not_read_are_a_reason() -> None:
    plugin = Plugin("gz_ros2_control-system", (), "", PLACE, ("'control.yaml' does not exist",))
    model = dataclasses.replace(TWO, plugins=(plugin,))
    assert recognise(model) is None
    assert why_not_recognised(model)[0] == (
        "the controllers of plugin gz_ros2_control-system at robot.urdf:7 are not known: 'control.yaml' does not exist"
    )


def test_wheels_of_a_plugin_that_roll_along_the_line_between_them_are_no_drive() -> None:
    model = asking(
        cart(wheel("a", 0.0, 0.3, axis=(1.0, 0.0, 0.0)), wheel("b", 0.0, -0.3, axis=(1.0, 0.0, 0.0))),
        *("DiffDrivePlugin", "left_joint=a right_joint=b wheel_separation=0.6"),
    )
    assert recognise(model) is None
    assert "its wheels roll along the line between the sides" in why_not_recognised(model)[0]


def test_a_plugin_of_a_nested_model_leaves_its_scope_out_unless_several_have_the_name() -> None:
    nested = cart(wheel("base::a", 0.0, 0.3), wheel("base::b", 0.0, -0.3))
    model = asking(nested, "gz-sim-diff-drive-system", "left_joint=a right_joint=base::b")
    assert recognise(model) == DiffDrive(left=("base::a",), right=("base::b",))
    twice = cart(wheel("one::a", 0.0, 0.3), wheel("two::a", 0.0, -0.3), wheel("b", 0.5, -0.3))
    model = asking(twice, "gz-sim-diff-drive-system", "left_joint=a right_joint=b")
    assert recognise(model) is None
    assert "does not fit: the model has no moving joint 'a'" in why_not_recognised(model)[0]
