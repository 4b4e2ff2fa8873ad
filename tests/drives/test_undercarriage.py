"""Undercarriages: casters, rockers and suspensions next to driven wheels, and why no drive is recognised."""

from __future__ import annotations

import dataclasses

import pytest

from sim_action.core.errors import Location
from sim_action.core.geometry import Pose, Vector3
from sim_action.drives import recognise, why_not_recognised
from sim_action.drives.ackermann import AckermannDrive
from sim_action.drives.diff import DiffDrive
from sim_action.drives.skid import SkidSteer
from sim_action.drives.undercarriage import ignored_statements, mirrored_names, undercarriage
from sim_action.robot.model.robot_model import CommandedJoint, Joint, JointType, Link, Plugin, RobotModel, Shape
from tests.drives.carts import FOUR, PLACE, RADIUS, Part, asking, cart, steered, wheel
from tests.drives.test_plugins import DIFF_CONTROLLER, SIDES, TWO

PAIR = (wheel("left", 0.0, 0.3), wheel("right", 0.0, -0.3))
DIFF = DiffDrive(left=("left",), right=("right",))
CASTER = steered("tail", -0.3, 0.0, limit=None)


def beam(name: str, x: float, y: float, axis: Vector3 = (0.0, 1.0, 0.0), kind: JointType = "revolute") -> Part:
    """A link between the base and wheels, on a joint with limits."""
    return (Joint(name, kind, "base", f"{name}_beam", Pose((x, y, 0.0)), axis, -0.3, 0.3),), (
        Link(f"{name}_beam", None),
    )


def ball(name: str, x: float, radius: float) -> Part:
    """A sphere that is fixed to the base and stands on the ground."""
    shape = Shape("sphere", Pose((x, 0.0, radius - RADIUS)), radius, (-radius,) * 3, (radius,) * 3)
    return (Joint(name, "fixed", "base", f"{name}_link", Pose(), (1.0, 0.0, 0.0)),), (
        Link(f"{name}_link", None, (shape,)),
    )


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


def test_a_rover_with_rockers_and_six_wheels_is_skid_steer() -> None:
    left, right = (tuple(f"{side}_{place}" for place in ("front", "middle", "rear")) for side in ("left", "right"))
    assert recognise(cart(*ROCKERS)) == SkidSteer(left=left, right=right)


def test_a_wheel_on_a_hinge_along_its_way_would_tip_over() -> None:
    hinges = (beam("a_hinge", 0.3, 0.3, (1.0, 0.0, 0.0)), wheel("a", 0.0, 0.0, parent="a_hinge_beam"))
    model = cart(*FOUR[1:], *hinges)
    assert recognise(model) is None
    assert "diff: joint 'a_hinge' lets the wheel at 'a' slide or tip over" in why_not_recognised(model)


def test_an_axle_that_tilts_as_a_whole_is_no_hinge() -> None:
    axle = beam("axle", 0.3, 0.0, (1.0, 0.0, 0.0))
    front = (wheel("a", 0.0, 0.3, parent="axle_beam"), wheel("c", 0.0, -0.3, parent="axle_beam"))
    assert recognise(cart(axle, *front, FOUR[1], FOUR[3])) == SkidSteer(left=("a", "b"), right=("c", "d"))


@pytest.mark.parametrize(("interface", "tag"), [("velocity", "ros2_control"), ("effort", "transmission")])
def test_motors_that_are_stated_decide_which_wheels_are_driven(interface: str, tag: str) -> None:
    model = commanded(cart(*FOUR), interface, "a", "c", tag=tag)
    drive = recognise(model)
    assert drive == DiffDrive(left=("a",), right=("c",))
    assert drive.source(model) == f"<{tag}> at robot.urdf:7"
    assert [found.joint for found in undercarriage(model).idle] == ["b", "d"]


def test_motors_of_other_joints_say_nothing_about_wheels() -> None:
    assert recognise(commanded(cart(*FOUR), "position", "elbow")) == SkidSteer(left=("a", "b"), right=("c", "d"))


def test_a_controller_of_a_single_joint_in_gz_is_a_motor() -> None:
    model = cart(*FOUR)
    for name in ("b", "d"):
        model = asking(model, "gz-sim-joint-controller-system", f"joint_name={name}")
    drive = recognise(model)
    assert drive == DiffDrive(left=("b",), right=("d",))
    assert drive.source(model) == "plugin gz-sim-joint-controller-system at robot.urdf:7"


def test_a_caster_with_limits_has_no_motor_where_motors_are_stated() -> None:
    model = cart(*PAIR, steered("tail", -0.3, 0.0, limit=3.0))
    assert recognise(model) is None
    assert recognise(commanded(model, "velocity", "left", "right")) == DIFF


def test_a_swivel_with_a_motor_is_no_caster() -> None:
    model = commanded(cart(*PAIR, CASTER), "velocity", "left", "right", "tail_steer")
    assert recognise(model) is None
    assert "diff: joint 'tail_steer' steers the wheel at 'tail'" in why_not_recognised(model)


def test_steering_joints_with_motors_steer_a_car() -> None:
    front = (steered("a", 0.5, 0.2, limit=0.6), steered("b", 0.5, -0.2, limit=0.6))
    model = cart(wheel("c", 0.0, 0.2), wheel("d", 0.0, -0.2), *front)
    model = commanded(commanded(model, "velocity", "c", "d"), "position", "a_steer", "b_steer")
    assert recognise(model) == AckermannDrive(steering=("a_steer", "b_steer"), wheels=("c", "d"))


def test_a_tricycle_needs_a_statement_of_its_motors() -> None:
    model = cart(*PAIR, steered("nose", 0.5, 0.0))
    assert recognise(model) is None
    stated = commanded(commanded(model, "velocity", "left", "right"), "position", "nose_steer")
    assert recognise(stated) == AckermannDrive(steering=("nose_steer",), wheels=("left", "right"))


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
]


@pytest.mark.parametrize(("model", "reason"), REASONS)
def test_a_model_without_a_drive_says_why(model: RobotModel, reason: str) -> None:
    assert recognise(model) is None
    assert any(found.startswith(reason) for found in why_not_recognised(model))


def test_the_most_likely_kind_comes_first() -> None:
    kinds = [reason.partition(":")[0] for reason in why_not_recognised(cart(*FOUR, wheel("e", 0.5, 0.3)))]
    assert kinds == ["skid", "diff", "mecanum", "ackermann"]
    assert why_not_recognised(cart(steered("a", 0.5, 0.0), *PAIR))[0].startswith("ackermann: steering joints: 1")


def test_a_wheel_with_limits_is_named() -> None:
    model = cart(*PAIR)
    joints = tuple(dataclasses.replace(joint, type="revolute", lower=-1.0, upper=1.0) for joint in model.joints)
    reason = "diff: 'left_link' is round and stands on the ground, but joint 'left' has limits"
    assert why_not_recognised(dataclasses.replace(model, joints=joints))[0] == reason


def test_a_wheel_without_a_collision_shape_is_named() -> None:
    model = cart(*PAIR, ball("tip", 0.0, 0.03))
    links = tuple(dataclasses.replace(link, collisions=()) if link.name != "tip_link" else link for link in model.links)
    found = why_not_recognised(dataclasses.replace(model, links=links))[0]
    assert found.startswith("diff: the link of 'left' has no collision shape")


@pytest.mark.parametrize(("below", "expected"), [(0.002, DIFF), (0.04, DIFF), (0.06, None)])
def test_a_ball_that_is_too_low_tilts_the_robot(below: float, expected: DiffDrive | None) -> None:
    (joint,), (link,) = ball("tail", -0.3, 0.03)
    (shape,) = link.collisions
    lower = dataclasses.replace(shape, pose=Pose((-0.3, 0.0, 0.03 - RADIUS - below)))
    assert recognise(cart(*PAIR, ((joint,), (dataclasses.replace(link, collisions=(lower,)),)))) == expected


def test_wheels_that_hang_in_the_air_are_named() -> None:
    found = why_not_recognised(cart(*PAIR, ball("tip", 0.0, 0.03), ball_below()))[0]
    assert (
        found == "diff: the wheel at 'left' ends 0.1 m above the ground: the lowest shape is the sphere of 'deep_link'"
    )


def ball_below() -> Part:
    shape = Shape("sphere", Pose((0.0, 0.0, -RADIUS - 0.05)), 0.05, (-0.05,) * 3, (0.05,) * 3)
    return (Joint("deep", "fixed", "base", "deep_link", Pose(), (1.0, 0.0, 0.0)),), (Link("deep_link", None, (shape,)),)


def test_wheels_about_upright_axes_are_named() -> None:
    model = cart(*(wheel(name, 0.0, y, axis=(0.0, 0.0, 1.0)) for name, y in (("left", 0.3), ("right", -0.3))))
    assert "whose joint 'left' has no level axis" in why_not_recognised(model)[0]


def test_fixed_wheels_at_the_front_make_a_pair_at_the_rear_uncertain() -> None:
    def fixed(name: str, y: float) -> Part:
        (joint,), links = wheel(name, 0.5, y)
        return (dataclasses.replace(joint, type="fixed"),), links

    model = cart(*PAIR, fixed("front_left_wheel", 0.3), fixed("front_right_wheel", -0.3))
    assert recognise(model) is None
    stands = "'front_left_wheel_link' and 'front_right_wheel_link' stand on the ground as well"
    assert why_not_recognised(model)[0] == f"diff: {stands}, but no joint lets them roll"


def test_wheels_with_rollers_in_their_names_are_not_skid_steer() -> None:
    names = ("mecanum_a", "mecanum_b", "mecanum_c", "mecanum_d")
    places = ((0.2, 0.3), (-0.2, 0.3), (0.2, -0.3), (-0.2, -0.3))
    model = cart(*(wheel(name, *place) for name, place in zip(names, places, strict=True)))
    assert recognise(model) is None
    assert why_not_recognised(model)[0].startswith("skid: 'mecanum_a_link' names wheels with rollers")
    assert recognise(dataclasses.replace(cart(*FOUR), name="rover_mecanum")) is None


def test_a_wheel_that_cannot_roll_is_named_with_its_joint() -> None:
    (joint,), links = wheel("left_wheel", 0.0, 0.3)
    model = cart(((dataclasses.replace(joint, type="fixed"),), links))
    assert why_not_recognised(model)[0].endswith("of 'left_wheel_link', whose joint 'left_wheel' is fixed")


@pytest.mark.parametrize(
    ("plugin", "parameters"), [("gazebo_ros_planar_move", ""), ("gz-sim-velocity-control-system", "topic=cmd_vel")]
)
def test_a_base_that_a_plugin_moves_has_no_drive(plugin: str, parameters: str) -> None:
    model = asking(cart(*FOUR), plugin, parameters)
    assert recognise(model) is None
    assert why_not_recognised(model)[0].startswith(f"plugin {plugin} at robot.urdf:7 moves the base itself")


def test_a_plugin_of_another_kind_rules_the_looks_of_wheels_out() -> None:
    model = asking(cart(*FOUR), "gz-sim-mecanum-drive-system", "front_left_joint=x")
    assert recognise(model) is None
    assert why_not_recognised(model)[0].startswith(
        "plugin gz-sim-mecanum-drive-system at robot.urdf:7 does not fit: the model has no moving joint 'x'"
    )


def test_a_plugin_whose_figures_do_not_fit_says_so() -> None:
    model = cart(PAIR[0], wheel("front", 0.5, 0.3))
    model = asking(model, "DiffDrivePlugin", "left_joint=left right_joint=front")
    assert recognise(model) is None
    assert why_not_recognised(model)[0].startswith("plugin DiffDrivePlugin at robot.urdf:7 does not fit: the left and")


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
