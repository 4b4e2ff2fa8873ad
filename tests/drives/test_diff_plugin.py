"""What Gazebo's plugins for diff drives say, what they mean by it, and which of them are passed over."""

from __future__ import annotations

import dataclasses

import pytest

from sim_action.core.geometry import Twist, Vector3
from sim_action.drives import recognise
from sim_action.drives.diff import DiffDrive
from tests.drives.carts import RADIUS, asking, cart, wheel
from tests.drives.test_diff import BURGER, LEFT, RIGHT, changed, without_radii
from tests.traces import burger

SIDES = f"left_joint={LEFT} right_joint={RIGHT}"
RATED = "legacyMode=false updateRate=30"
OLD_SIDES = f"leftJoint={LEFT} rightJoint={RIGHT}"
WHEELS = "left_joint=a right_joint=b"


@pytest.mark.parametrize(
    ("plugin", "parameters", "figures"),
    [
        (
            "gazebo_ros_diff_drive",
            f"{OLD_SIDES} wheelSeparation=0.2 wheelDiameter=0.08 wheelAcceleration=2.5 wheelTorque=7 {RATED}",
            {"separation": 0.2, "radius": 0.04, "acceleration": 2.5, "torque": 7.0},
        ),
        (
            "gazebo_ros_diff_drive",
            f"{SIDES} wheel_separation=0.2 wheel_diameter=0.08 max_wheel_acceleration=0 max_wheel_torque=inf",
            {"separation": 0.2, "radius": 0.04},
        ),
        ("gz-sim-diff-drive-system", f"{SIDES} wheel_radius=wide", {}),
    ],
    ids=["ROS 1", "ROS 2", "gz"],
)
def test_what_a_plugin_says_is_taken(plugin: str, parameters: str, figures: dict[str, float]) -> None:
    assert recognise(asking(burger(), plugin, parameters)) == DiffDrive(left=(LEFT,), right=(RIGHT,), **figures)


NO_LIMIT = "; the plugin has no limit for wheel acceleration, so 1 m/s^2 is used"
SWAPPED = (
    "; sides swapped, as gazebo_ros_diff_drive does without <legacyMode>false</legacyMode>: "
    "rightJoint is the left wheel"
)


@pytest.mark.parametrize(
    ("name", "parameters", "remark"),
    [
        ("gazebo_ros_diff_drive", {"legacyMode": "false", "wheelAcceleration": "1"}, ""),
        ("gazebo_ros_diff_drive", {"legacyMode": " False ", "wheelAcceleration": "0"}, NO_LIMIT),
        ("gazebo_ros_diff_drive", {"legacyMode": "0"}, NO_LIMIT),
        ("gazebo_ros_diff_drive", {"legacyMode": "true", "wheelAcceleration": "1"}, SWAPPED),
        ("gazebo_ros_diff_drive", {}, SWAPPED + NO_LIMIT),
        ("gz-sim-diff-drive-system", {"max_linear_acceleration": "1"}, ""),
        ("gz-sim-diff-drive-system", {"max_angular_acceleration": "1"}, NO_LIMIT),
    ],
)
def test_what_a_plugin_means_beside_what_it_says_is_told(name: str, parameters: dict[str, str], remark: str) -> None:
    ros1 = name.startswith("gazebo_ros")
    model = asking(burger(), name, OLD_SIDES if ros1 else SIDES)
    (plugin,) = model.plugins
    told = (*plugin.parameters, *parameters.items())
    model = dataclasses.replace(model, plugins=(dataclasses.replace(plugin, parameters=told),))
    drive = recognise(model)
    assert isinstance(drive, DiffDrive)
    assert (drive.left, drive.right) == (((RIGHT,), (LEFT,)) if SWAPPED in remark else ((LEFT,), (RIGHT,)))
    assert drive.describe(model) == drive.describe(burger()) + remark


FORWARD, BACKWARD = (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)


@pytest.mark.parametrize("axis", [FORWARD, BACKWARD], ids=["forward", "backward"])
@pytest.mark.parametrize(("left", "right"), [("a", "b"), ("b", "a")], ids=["as named", "exchanged"])
@pytest.mark.parametrize(("legacy", "way"), [("true", -1), ("false", 1)])
def test_joints_turn_as_gazebo_turns_them(axis: Vector3, left: str, right: str, legacy: str, way: int) -> None:
    model = cart(wheel("a", 0.0, 0.3, axis=axis), wheel("b", 0.0, -0.3, axis=axis))
    model = asking(model, "gazebo_ros_diff_drive", f"leftJoint={left} rightJoint={right} legacyMode={legacy}")
    drive = recognise(model)
    assert drive is not None
    (targets,) = drive.open(model, 0.1).targets(Twist.planar(1.0, 2.0), 1)
    ahead, turn = 1.0 / RADIUS, 2.0 * 0.3 / RADIUS
    assert targets.velocity == pytest.approx({left: ahead - way * turn, right: ahead + way * turn})


def test_sides_that_a_plugin_exchanges_or_would_turn_against_each_other_go_ahead() -> None:
    drive = recognise(asking(burger(), "gz-sim-diff-drive-system", f"left_joint={RIGHT} right_joint={LEFT}"))
    assert drive == DiffDrive(left=(RIGHT,), right=(LEFT,), heading=0.0)
    model = cart(wheel("a", 0.0, 0.3, axis=FORWARD), wheel("b", 0.0, -0.3, axis=BACKWARD))
    assert recognise(asking(model, "gz-sim-diff-drive-system", WHEELS)) == DiffDrive(left=("a",), right=("b",))


def test_ros_2_has_no_legacy_mode_and_a_drive_that_is_stated_nothing_to_tell_of_the_plugin() -> None:
    assert recognise(asking(burger(), "gazebo_ros_diff_drive", SIDES)) == BURGER
    assert BURGER.describe(asking(burger(), "gazebo_ros_diff_drive", OLD_SIDES)) == BURGER.describe(burger())


def test_a_plugin_names_wheels_whatever_they_are_called_but_not_without_their_diameter() -> None:
    model = changed(burger(), wheel_left_joint={"name": "a"}, wheel_right_joint={"name": "b"})
    assert recognise(model) is None
    assert recognise(asking(model, "gazebo_ros_diff_drive", WHEELS)) == DiffDrive(left=("a",), right=("b",))
    assert recognise(without_radii(asking(burger(), "gazebo_ros_diff_drive", SIDES))) is None


@pytest.mark.parametrize(
    ("plugin", "parameters"),
    [
        ("gazebo_ros_diff_drive", f"leftJoint=front rightJoint={RIGHT} wheelSeparation=9"),
        ("gazebo_ros_diff_drive", f"leftJoint={LEFT} wheelSeparation=9"),
        ("gazebo_ros_imu", f"{OLD_SIDES} wheelSeparation=9"),
        ("gazebo_ros_diff_drive", f"leftJoint={LEFT} rightJoint={LEFT} wheelSeparation=9"),
        ("gazebo_ros_diff_drive", f"{SIDES} wheel_diameter=1e-300"),
        ("gazebo_ros_diff_drive", f"{SIDES} wheel_separation=1e-9"),
    ],
    ids=["an unknown joint", "one side", "another plugin", "a wheel on both sides", "no diameter", "no separation"],
)
def test_a_plugin_that_does_not_fit_is_passed_over(plugin: str, parameters: str) -> None:
    assert recognise(asking(burger(), plugin, parameters)) == BURGER


@pytest.mark.parametrize(
    ("name", "read"),
    [
        ("gazebo_ros_diff_drive", {"wheelTorque", "max_wheel_torque"}),
        ("DiffDrivePlugin", {"torque"}),
        ("gz-sim-diff-drive-system", set()),
        ("diff_drive_controller/DiffDriveController", set()),
    ],
)
@pytest.mark.parametrize("tag", ["torque", "wheelTorque", "max_wheel_torque", "MaxForce"])
def test_each_plugin_reads_its_own_tag_for_the_torque(name: str, read: set[str], tag: str) -> None:
    model = asking(burger(), name, f"{SIDES} {tag}=0.1")
    drive = recognise(model)
    assert isinstance(drive, DiffDrive)
    assert drive.torque == (0.1 if tag in read else None)
    assert (f"<{tag}> has no effect, as in Gazebo" in drive.describe(model)) == (tag not in read)
