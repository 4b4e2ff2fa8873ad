"""Undercarriages: casters, rockers and suspensions next to driven wheels, and why no drive is recognised."""

from __future__ import annotations

import dataclasses

import pytest

from sim_action.core.errors import Location
from sim_action.core.geometry import Pose, Vector3
from sim_action.drives import Drive, recognise, why_not_recognised
from sim_action.drives.ackermann import AckermannDrive
from sim_action.drives.diff import DiffDrive
from sim_action.drives.skid import SkidSteer
from sim_action.drives.undercarriage import ignored_statements, mirrored_names, undercarriage
from sim_action.robot.model.robot_model import CommandedJoint, Joint, JointType, Link, Plugin, RobotModel, Shape
from tests.drives.carts import CAR, FOUR, PLACE, RADIUS, Part, asking, cart, steered, wheel
from tests.drives.test_plugins import DIFF_CONTROLLER, SIDES, TWO

PAIR = (wheel("left", 0.0, 0.3), wheel("right", 0.0, -0.3))
DIFF = DiffDrive(left=("left",), right=("right",))
CASTER = steered("tail", -0.3, 0.0, limit=None)


def beam(name: str, x: float, y: float, axis: Vector3 = (0.0, 1.0, 0.0), kind: JointType = "revolute") -> Part:
    """A link between the base and wheels, on a joint with limits."""
    return (Joint(name, kind, "base", f"{name}_beam", Pose((x, y, 0.0)), axis, -0.3, 0.3),), (
        Link(f"{name}_beam", None),
    )


def ball(name: str, x: float, radius: float, below: float = 0.0) -> Part:
    """A sphere that is fixed to the base and ends `below` m under the ground."""
    shape = Shape("sphere", Pose((x, 0.0, radius - RADIUS - below)), radius, (-radius,) * 3, (radius,) * 3)
    return (Joint(name, "fixed", "base", f"{name}_link", Pose(), (1.0, 0.0, 0.0)),), (
        Link(f"{name}_link", None, (shape,)),
    )


def fixed(name: str, x: float, y: float) -> Part:
    (joint,), links = wheel(name, x, y)
    return (dataclasses.replace(joint, type="fixed"),), links


def commanded(model: RobotModel, interface: str, *names: str, tag: str = "ros2_control") -> RobotModel:
    joints = tuple(CommandedJoint(name, frozenset({interface}), tag, PLACE) for name in names)
    return dataclasses.replace(model, commanded=(*model.commanded, *joints))


ROCKERS = (
    *(beam(f"{side}_rocker", 0.0, y) for side, y in (("left", 0.3), ("right", -0.3))),
    *(
        wheel(f"{side}_{place}", x, 0.0, parent=f"{side}_rocker_beam")
        for side in ("left", "right")
        for place, x in (("front", 0.3), ("middle", 0.0), ("rear", -0.3))
    ),
)


@pytest.mark.parametrize(
    "parts",
    [
        (*PAIR, CASTER),
        (*PAIR, CASTER, steered("nose", 0.3, 0.0, limit=None)),
        (*PAIR, ball("ball", -0.3, 0.03)),
        (*PAIR, *(ball(name, x, 0.03) for name, x in (("front_wheel", 0.3), ("rear_wheel", -0.3)))),
        (
            *(beam(f"{side}_spring", 0.0, y, (0.0, 0.0, 1.0), "prismatic") for side, y in (("l", 0.3), ("r", -0.3))),
            *(wheel(name, 0.0, 0.0, parent=f"{name[0]}_spring_beam") for name in ("left", "right")),
            CASTER,
        ),
    ],
    ids=["swivel caster", "two swivel casters", "ball", "balls that are called wheels", "suspension"],
)
def test_the_driven_pair_is_found_next_to_other_things_that_roll(parts: tuple[Part, ...]) -> None:
    drive = recognise(cart(*parts))
    assert drive == DIFF
    assert drive.source(cart(*parts)) == "geometry"


SKID = SkidSteer(left=("a", "b"), right=("c", "d"))
SIX = {side: tuple(f"{side}_{place}" for place in ("front", "middle", "rear")) for side in ("left", "right")}
TILTING = beam("axle", 0.3, 0.0, (1.0, 0.0, 0.0))
TILTED = (wheel("a", 0.0, 0.3, parent="axle_beam"), wheel("c", 0.0, -0.3, parent="axle_beam"))
TAILED = cart(*PAIR, steered("tail", -0.3, 0.0, limit=3.0))
TRICYCLE = cart(*PAIR, steered("nose", 0.5, 0.0))
UNROLLING = cart(*PAIR, fixed("left_wheel", 0.5, 0.3), fixed("right_wheel", 0.5, -0.3))
MOVED: dict[str, tuple[RobotModel, Drive | None]] = {
    "rockers and six wheels": (cart(*ROCKERS), SkidSteer(left=SIX["left"], right=SIX["right"])),
    "an axle that tilts as a whole is no hinge": (cart(TILTING, *TILTED, FOUR[1], FOUR[3]), SKID),
    "motors of other joints": (commanded(cart(*FOUR), "position", "elbow"), SKID),
    "a caster with limits could have a motor": (TAILED, None),
    "a caster with limits, and motors that are stated": (commanded(TAILED, "velocity", "left", "right"), DIFF),
    "fixed wheels at the front, and motors that are stated": (commanded(UNROLLING, "velocity", "left", "right"), DIFF),
    "steering joints with motors": (
        commanded(commanded(CAR, "velocity", "c", "d"), "position", "a_steer", "b_steer"),
        AckermannDrive(steering=("a_steer", "b_steer"), wheels=("c", "d")),
    ),
    "a tricycle needs a statement of its motors": (TRICYCLE, None),
    "a tricycle with its motors": (
        commanded(commanded(TRICYCLE, "velocity", "left", "right"), "position", "nose_steer"),
        AckermannDrive(steering=("nose_steer",), wheels=("left", "right")),
    ),
}


@pytest.mark.parametrize(("model", "drive"), MOVED.values(), ids=MOVED)
def test_joints_and_motors_next_to_wheels_decide_on_the_drive(model: RobotModel, drive: Drive | None) -> None:
    assert recognise(model) == drive


@pytest.mark.parametrize(("interface", "tag"), [("velocity", "ros2_control"), ("effort", "transmission")])
def test_motors_that_are_stated_decide_which_wheels_are_driven(interface: str, tag: str) -> None:
    model = commanded(cart(*FOUR), interface, "a", "c", tag=tag)
    drive = recognise(model)
    assert drive == DiffDrive(left=("a",), right=("c",))
    assert drive.source(model) == f"<{tag}> at robot.urdf:7"
    assert [found.joint for found in undercarriage(model).idle] == ["b", "d"]


def test_a_controller_of_a_single_joint_in_gz_is_a_motor() -> None:
    model = cart(*FOUR)
    for name in ("b", "d"):
        model = asking(model, "gz-sim-joint-controller-system", f"joint_name={name}")
    drive = recognise(model)
    assert drive == DiffDrive(left=("b",), right=("d",))
    assert drive.source(model) == "plugin gz-sim-joint-controller-system at robot.urdf:7"


REASONS = [
    (cart(), "diff: the model has no collision shapes, so nothing stands on the ground"),
    (
        cart(ball("tip", 0.0, 0.03)),
        "diff: no round link on a 'continuous' joint stands on the ground: the lowest shape is the sphere of 'tip_link",
    ),
    (
        cart(wheel("left_1", 0.0, 0.3), wheel("right", 0.0, -0.3)),
        "diff: 'left_1', 'right' stand on the ground, but their names do not show which is on the left",
    ),
    (
        cart(PAIR[0], wheel("right", 0.2, -0.3)),
        "diff: 'left', 'right' are not on one axle: one is 0.2 m ahead of the other",
    ),
    (cart(PAIR[0], *FOUR[2:]), "diff: wheels on the ground that could be driven: 3 ('left', 'c', 'd'); a"),
    (cart(*FOUR[:3]), "skid: wheels on the ground that could be driven: 3; skid steer has 4 or more"),
    (cart(*FOUR, wheel("e", 0.5, 0.3)), "skid: there are 3 wheels on the left and 2 on the right"),
    (
        cart(*FOUR[1:], beam("a_hinge", 0.3, 0.3, (1.0, 0.0, 0.0)), wheel("a", 0.0, 0.0, parent="a_hinge_beam")),
        "diff: joint 'a_hinge' lets the wheel at 'a' slide or tip over",
    ),
    (
        commanded(cart(*PAIR, CASTER), "velocity", "left", "right", "tail_steer"),
        "diff: joint 'tail_steer' steers the wheel at 'tail'",
    ),
]


@pytest.mark.parametrize(("model", "reason"), REASONS)
def test_a_model_without_a_drive_says_why(model: RobotModel, reason: str) -> None:
    assert recognise(model) is None
    assert any(found.startswith(reason) for found in why_not_recognised(model))


def test_the_most_likely_kind_comes_first() -> None:
    kinds = [reason.partition(":")[0] for reason in why_not_recognised(cart(*FOUR, wheel("e", 0.5, 0.3)))]
    assert kinds == ["skid", "diff", "mecanum", "ackermann"]
    assert why_not_recognised(cart(steered("a", 0.5, 0.0), *PAIR))[0].startswith("ackermann: steering joints: 1")
    assert why_not_recognised(cart(PAIR[0], *FOUR[2:]))[0].startswith("diff: wheels on the ground that could be driven")


@pytest.mark.parametrize(("below", "expected"), [(0.002, DIFF), (0.04, DIFF), (0.06, None)])
def test_a_ball_that_is_too_low_tilts_the_robot(below: float, expected: DiffDrive | None) -> None:
    assert recognise(cart(*PAIR, ball("tail", -0.3, 0.03, below))) == expected


PLACES = ((0.2, 0.3), (-0.2, 0.3), (0.2, -0.3), (-0.2, -0.3))
TIP = ball("tip", 0.0, 0.03)
# model, and a part of the first reason
FIRST_REASONS: dict[str, tuple[RobotModel, str]] = {
    "wheels with limits": (
        dataclasses.replace(
            cart(*PAIR),
            joints=tuple(dataclasses.replace(joint, type="revolute", lower=-1.0, upper=1.0) for (joint,), _ in PAIR),
        ),
        "diff: 'left_link' is round and stands on the ground, but joint 'left' has limits",
    ),
    "wheels without collision shapes": (
        cart(*((joints, tuple(Link(link.name, None) for link in links)) for joints, links in PAIR), TIP),
        "diff: the link of 'left' has no collision shape",
    ),
    "wheels in the air": (
        cart(*PAIR, TIP, ball("deep", 0.0, 0.05, 0.1)),
        "diff: the wheel at 'left' ends 0.1 m above the ground: the lowest shape is the sphere of 'deep_link'",
    ),
    "upright axes": (
        cart(*(wheel(name, 0.0, y, axis=(0.0, 0.0, 1.0)) for name, y in (("left", 0.3), ("right", -0.3)))),
        "whose joint 'left' has no level axis",
    ),
    "fixed wheels at the front": (
        UNROLLING,
        "diff: 'left_wheel_link' and 'right_wheel_link' stand on the ground as well, but no joint lets them roll",
    ),
    "wheels with rollers in their names": (
        cart(*(wheel(f"mecanum_{name}", *place) for name, place in zip("abcd", PLACES, strict=True))),
        "skid: 'mecanum_a_link' names wheels with rollers",
    ),
    "rollers in the name of the model": (dataclasses.replace(cart(*FOUR), name="rover_mecanum"), "rollers"),
    "a wheel that cannot roll": (
        cart(fixed("left_wheel", 0.0, 0.3)),
        "of 'left_wheel_link', whose joint 'left_wheel' is fixed",
    ),
    "planar_move": (
        asking(cart(*FOUR), "gazebo_ros_planar_move"),
        "plugin gazebo_ros_planar_move at robot.urdf:7 moves the base itself",
    ),
    "velocity control": (
        asking(cart(*FOUR), "gz-sim-velocity-control-system", "topic=cmd_vel"),
        "plugin gz-sim-velocity-control-system at robot.urdf:7 moves the base itself",
    ),
    "tracks": (
        asking(cart(), "gz-sim-tracked-vehicle-system"),
        "plugin gz-sim-tracked-vehicle-system at robot.urdf:7 moves tracks, which are not simulated",
    ),
    "a plugin of another kind": (
        asking(cart(*FOUR), "gz-sim-mecanum-drive-system", "front_left_joint=x"),
        "plugin gz-sim-mecanum-drive-system at robot.urdf:7 does not fit: the model has no moving joint 'x'",
    ),
    "a plugin whose figures do not fit": (
        asking(cart(PAIR[0], wheel("front", 0.5, 0.3)), "DiffDrivePlugin", "left_joint=left right_joint=front"),
        "plugin DiffDrivePlugin at robot.urdf:7 does not fit: the left and",
    ),
}


@pytest.mark.parametrize(("model", "reason"), FIRST_REASONS.values(), ids=FIRST_REASONS)
def test_the_first_reason_names_the_part_that_is_to_blame(model: RobotModel, reason: str) -> None:
    assert recognise(model) is None
    assert reason in why_not_recognised(model)[0]


@pytest.mark.parametrize(
    ("one", "other", "expected"),
    [
        ("left_wheel", "right_wheel", ("left_wheel", "right_wheel")),
        ("r_wheel_joint", "l_wheel_joint", ("l_wheel_joint", "r_wheel_joint")),
        ("WheelLeft", "WheelRight", ("WheelLeft", "WheelRight")),
        ("base_wheelR", "base_wheelL", ("base_wheelL", "base_wheelR")),
        ("wheel_l", "wheel_right", None),
        ("a", "b", None),
    ],
)
def test_names_of_two_sides_mirror_each_other(one: str, other: str, expected: tuple[str, str] | None) -> None:
    assert mirrored_names(one, other) == expected


GZ_DIFF = "gz-sim-diff-drive-system"


def notes(model: RobotModel) -> list[str]:
    drive = recognise(model)
    assert drive is not None
    return list(ignored_statements(model, drive.source(model), drive.open(model, 100).joints))


@pytest.mark.parametrize(
    ("name", "parameters", "ignored"),
    [
        (GZ_DIFF, "max_linear_velocity=0.2", "max_linear_velocity 0.2"),
        (GZ_DIFF, "max_velocity=0.2 max_angular_velocity=1", "max_velocity 0.2, max_angular_velocity 1"),
        (GZ_DIFF, "max_velocity=0 max_acceleration=1", None),
        (DIFF_CONTROLLER, "linear.x.max_velocity=0.2", "linear.x.max_velocity 0.2"),
        (DIFF_CONTROLLER, "linear.x.max_velocity=.nan", None),
        (DIFF_CONTROLLER, "linear.x.max_velocity=1 linear.x.has_velocity_limits=False", None),
    ],
)
def test_speed_limits_are_named(name: str, parameters: str, ignored: str | None) -> None:
    sides = SIDES if name == DIFF_CONTROLLER else "left_joint=a right_joint=b"
    found = notes(asking(TWO, name, f"{sides} {parameters}", "base"))
    assert [note.split(" of ")[0] for note in found] == ([] if ignored is None else [ignored])


def test_other_plugins_and_unread_files_are_named() -> None:
    model = asking(TWO, GZ_DIFF, "left_joint=a right_joint=b")
    second = dataclasses.replace(model.plugins[0], location=Location("control.yaml", 9))
    control = Plugin("gz_ros2_control-system", (), "", PLACE, ("'nope.yaml' does not exist",))
    found = notes(dataclasses.replace(model, plugins=(*model.plugins, second, control)))
    assert [note.split(", ")[0] for note in found] == [
        "plugin gz-sim-diff-drive-system at control.yaml:9 is ignored",
        "the controllers of plugin gz_ros2_control-system at robot.urdf:7 are not known: 'nope.yaml' does not exist",
    ]


def test_wheels_with_motors_that_the_drive_does_not_turn_are_named() -> None:
    model = commanded(cart(*FOUR), "velocity", *"abcd", tag="transmission")
    found = notes(asking(model, GZ_DIFF, "left_joint=a right_joint=c"))
    assert [note.split(",")[0] for note in found] == ["the model states motors of 'b'"]
