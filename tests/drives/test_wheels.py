"""Wheels of a model: radius and place."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.geometry import Pose, Twist, Vector3, quaternion_from_rpy, rotate
from sim_action.drives import wheels
from sim_action.drives.diff import DiffDrive
from sim_action.drives.wheels import (
    Lowest,
    NotRound,
    Tyre,
    Wheel,
    axis_in_base,
    centre_of_mass,
    heading_of,
    held_joints,
    lowest_shape,
    opposed_note,
    rolling,
    turned_forward,
    tyre_of,
    wheel,
    wheels_on_ground,
)
from sim_action.meshes.collision_hulls import shrunk
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_model import ENGINE_MARGIN_M, Joint, Link, RobotModel, Shape, Visual
from sim_action.robot.reading.urdf import read_urdf
from tests.drives.carts import FOUR, LYING, Part, cart, steered
from tests.drives.carts import wheel as cart_wheel
from tests.soak import examples
from tests.traces import burger

# The axle is turned a quarter about z and the wheel hangs on it: 1 m forward of the axle is 1 m to the left.
NESTED = """
<robot name="nested">
  <link name="base">
    <inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
  </link>
  <link name="axle"/>
  <link name="wheel">
    <collision><geometry><box size="1 1 1"/></geometry></collision>
    <collision><geometry><cylinder radius="0.25" length="0.1"/></geometry></collision>
  </link>
  <link name="block"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
  <joint name="turn" type="fixed">
    <parent link="base"/><child link="axle"/><origin xyz="2 0 0.5" rpy="0 0 1.5707963267948966"/>
  </joint>
  <joint name="spin" type="continuous"><parent link="axle"/><child link="wheel"/><origin xyz="1 0 0"/></joint>
  <joint name="drag" type="continuous"><parent link="base"/><child link="block"/></joint>
</robot>
"""


@pytest.fixture
def nested(tmp_path: Path) -> RobotModel:
    (tmp_path / "nested.urdf").write_text(NESTED)
    return read_urdf(tmp_path / "nested.urdf")


def test_the_burgers_wheels_are_as_published() -> None:
    left, right = (wheel(burger(), f"wheel_{side}_joint") for side in ("left", "right"))
    assert (left.radius, right.radius) == (0.033, 0.033)
    assert left.position_xyz == pytest.approx((0, 0.08, 0.033))
    assert right.position_xyz == pytest.approx((0, -0.08, 0.033))


def test_a_wheel_is_placed_through_all_the_joints_above_it_and_has_the_radius_of_its_first_round_shape(
    nested: RobotModel,
) -> None:
    assert wheel(nested, "spin").position_xyz == pytest.approx((2, 1, 0.5))
    assert (wheel(nested, "spin").radius, wheel(nested, "drag").radius) == (0.25, None)
    assert centre_of_mass(nested) == (0.0, 0.0, 0.0)  # no mass is stated
    with pytest.raises(KeyError):
        wheel(nested, "absent")


def test_a_wheel_is_where_the_joints_above_it_begin(tmp_path: Path) -> None:
    limited = '<axis xyz="0 0 1"/><limit lower="0.5" upper="1.5"/></joint>'
    text = NESTED.replace('name="turn" type="fixed"', 'name="turn" type="revolute"').replace("</joint>", limited, 1)
    (tmp_path / "swung.urdf").write_text(text)
    turned = math.pi / 2 + 1.0
    at = wheel(read_urdf(tmp_path / "swung.urdf"), "spin").position_xyz
    assert at == pytest.approx((2 + math.cos(turned), math.sin(turned), 0.5))


def test_the_mass_is_where_the_links_have_theirs() -> None:
    # Chassis, wheels, caster and laser; the wheels are at x = 0.
    ahead = (0.826 * -0.032 + 0.005 * -0.081 + 0.114 * -0.032) / 1.002
    x, y, _ = centre_of_mass(burger())
    assert [x, y] == pytest.approx([ahead, 0.0])


def test_a_model_is_walked_through_once_however_often_a_drive_asks(
    nested: RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Or checking 10,000 variations takes a minute, of which nine parts are spent on the same poses."""
    asked: list[RobotModel] = []

    def counted(model: RobotModel, positions: dict[str, float]) -> dict[str, Pose]:
        asked.append(model)
        return link_poses(model, positions)

    monkeypatch.setattr(wheels, "link_poses", counted)
    for _ in range(3):
        found = {joint.name: wheel(nested, joint.name) for joint in nested.joints}
        wheels_on_ground(nested)
        centre_of_mass(nested)
    assert [id(model) for model in asked] == [id(nested)]
    # What says something else, if only so much, is walked through on its own.
    turned = replace(nested, joints=tuple(replace(joint, origin=Pose((9.0, 0.0, 0.0))) for joint in nested.joints))
    assert {joint.name: wheel(turned, joint.name) for joint in turned.joints} != found


def wheel_rolling(direction: float, ahead: float = 0.0, left: float = 0.0, turns: int = 1) -> Wheel:
    """A wheel that rolls towards a direction in rad, at a place seen in that direction."""
    cosine, sine = math.cos(direction), math.sin(direction)
    place = (cosine * ahead - sine * left, sine * ahead + cosine * left, 0.0)
    return Wheel("w", 0.1, place, (-turns * sine, turns * cosine, 0.0))


directions = st.floats(-3.1, 3.1)
signs = st.sampled_from([1, -1])


@given(directions, signs, signs)
def test_left_and_right_tell_which_way_is_forward(direction: float, one: int, other: int) -> None:
    left, right = [wheel_rolling(direction, 0.2, 0.5, one)], [wheel_rolling(direction, 0.1, -0.5, other)]
    assert heading_of((*left, *right), left, right) == pytest.approx(direction)


@given(directions, signs)
def test_without_sides_forward_is_nearer_to_x(direction: float, turns: int) -> None:
    heading = heading_of([wheel_rolling(direction, turns=turns)])
    assert math.cos(heading) >= -1e-9
    assert math.sin(heading - direction) == pytest.approx(0.0, abs=1e-9)


@given(directions, signs)
def test_joints_that_turn_forward_roll_wheels_where_their_axes_say(direction: float, turns: int) -> None:
    heading = turned_forward(
        [wheel_rolling(direction, left=0.5, turns=turns), wheel_rolling(direction, left=-0.5, turns=turns)]
    )
    assert heading is not None
    there = [turns * math.cos(direction), turns * math.sin(direction)]
    assert [math.cos(heading), math.sin(heading)] == pytest.approx(there, abs=1e-8)
    assert turned_forward([wheel_rolling(direction), wheel_rolling(direction, turns=-1)]) is None


@given(directions, st.floats(-1, 1), st.floats(-1, 1), signs)
def test_a_wheel_is_seen_in_the_direction_of_its_drive(direction: float, ahead: float, left: float, turns: int) -> None:
    seen = rolling(wheel_rolling(direction, ahead, left, turns), direction)
    assert [seen.ahead, seen.left, seen.turns] == pytest.approx([ahead, left, turns])


def test_along_y_and_upright_axles() -> None:
    assert heading_of([wheel_rolling(-math.pi / 2)]) == pytest.approx(math.pi / 2)
    assert heading_of([Wheel("w", 0.1, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))]) == 0.0


UP = (0.0, 1.0, 0.0)
DOWN = (0.0, -1.0, 0.0)


@pytest.mark.parametrize(
    ("axes", "named"),
    [
        ({}, None),
        ({"a": UP, "b": UP}, None),
        ({"a": UP, "b": DOWN}, "joint 'b': the"),
        ({"a": DOWN, "b": UP}, "joint 'a': the"),
        ({"a": DOWN, "b": DOWN}, None),
        ({"a": DOWN, "b": UP, "c": DOWN, "d": DOWN}, "joint 'b': the"),
        ({"a": UP, "b": DOWN, "c": UP, "d": DOWN}, "joints 'b', 'd': the"),
        ({"a": UP, "b": (1.0, 0.0, 0.0)}, None),
    ],
)
def test_a_wheel_whose_axis_points_the_other_way_is_named(axes: dict[str, Vector3], named: str | None) -> None:
    note = opposed_note(axes)
    assert (named in note) if named and note else (note is named)


def roll_joint(name: str, z: float, *, parent: str = "base", effort: float | None = None) -> Part:
    """A continuous joint of an arm about a level axis, with a round link."""
    shape = Shape("cylinder", LYING, 0.05, (-0.05, -0.05, -0.02), (0.05, 0.05, 0.02))
    place = Pose((0.0, 0.0, z))
    joint = Joint(name, "continuous", parent, f"{name}_link", place, (0.0, 1.0, 0.0), max_effort=effort)
    return (joint,), (Link(f"{name}_link", 1.0, (shape,)),)


def hinge(name: str, stiffness: float = 0.0) -> Part:
    """A joint with limits and without an effort limit."""
    joint = Joint(name, "revolute", "base", name, Pose(), (0.0, 1.0, 0.0), -1.0, 1.0, stiffness=stiffness)
    return (joint,), (Link(name, 1.0),)


def with_motors(model: RobotModel) -> RobotModel:
    """The same model with an effort limit on every joint."""
    return replace(model, joints=tuple(replace(joint, max_effort=50.0) for joint in model.joints))


def test_joints_of_arms_and_legs_are_held_and_wheels_are_not() -> None:
    arm = (roll_joint("strong", 1.0, effort=50.0), roll_joint("limp", 1.2), roll_joint("zero", 1.4, effort=0.0))
    assert held_joints(cart(*FOUR, *arm)) == {"strong"}
    assert held_joints(cart(*FOUR, hinge("hinge"), hinge("sprung", 5.0))) == {"hinge"}
    caster = steered("tail", -0.3, 0.0, limit=None)
    lifted = cart_wheel("lifted", 0.0, 0.0, radius=0.06)
    assert held_joints(with_motors(cart(*FOUR, caster, lifted))) == frozenset()
    # A round motor of a leg is no wheel, although its link stands on the ground.
    hip = roll_joint("hip", 0.0, effort=5.0)
    assert held_joints(cart(hip)) == frozenset()
    knee = Joint("knee", "revolute", "hip_link", "shank", Pose(), (0.0, 1.0, 0.0), -1.0, 1.0)
    assert held_joints(cart(hip, ((knee,), (Link("shank", 1.0),)))) == {"hip", "knee"}


def test_a_link_that_is_called_a_wheel_rolls_even_if_it_is_not_round() -> None:
    # The outline of a mesh without corners is unknown, as that of a wheel with lugs.
    shape = Shape("box", Pose(), None, (-0.1,) * 3, (0.1,) * 3)
    for name, is_held in (("track_wheel", False), ("paddle", True)):
        joint = Joint(name, "continuous", "base", name, Pose(), (0.0, 1.0, 0.0), max_effort=5.0)
        assert bool(held_joints(cart(*FOUR, ((joint,), (Link(name, 1.0, (shape,)),))))) is is_held


@pytest.mark.parametrize("axis", ["0 1 0", "0 -1 0"])
@pytest.mark.parametrize("has_plugin", [True, False])
def test_a_reversed_axis_spins_the_robot_of_a_plugin_as_in_gazebo(axis: str, has_plugin: bool, tmp_path: Path) -> None:
    wheels = "".join(
        f'<link name="{side}_wheel"><collision><origin rpy="1.5707963267948966 0 0"/><geometry>'
        f'<cylinder radius="0.05" length="0.02"/></geometry></collision></link><joint name="{side}" type="continuous">'
        f'<parent link="base"/><child link="{side}_wheel"/><origin xyz="0 {y} 0"/><axis xyz="{turned}"/></joint>'
        for side, y, turned in (("left", 0.2, "0 1 0"), ("right", -0.2, axis))
    )
    plugin = (
        '<gazebo><plugin filename="libgazebo_ros_diff_drive.so"><left_joint>left</left_joint>'
        "<right_joint>right</right_joint></plugin></gazebo>"
    )
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="r"><link name="base"/>{wheels}{plugin * has_plugin}</robot>', encoding="utf-8")
    model = read_urdf(path)
    drive = DiffDrive.statement(model) if has_plugin else DiffDrive(left=("left",), right=("right",))
    assert drive is not None
    speeds = drive.open(model, 240.0).targets(Twist((0.1, 0, 0)), 200)[-1].velocity
    is_spinning = has_plugin and axis == "0 -1 0"
    assert speeds["left"] > 0
    assert speeds["right"] == pytest.approx(speeds["left"] * (1 if axis == "0 1 0" or is_spinning else -1))
    axes = {name: axis_in_base(model, model.joints_by_name[name]) for name in ("left", "right")}
    note = opposed_note(axes, drive.plugin(model)) or ""
    assert ("as with plugin" in note) == is_spinning


ACROSS: Vector3 = (0.0, 1.0, 0.0)
JOINT = Joint("spin", "continuous", "base", "wheel", Pose(), ACROSS)


def mesh(points: Iterable[Vector3]) -> Shape:
    """A mesh shape with one hull, as the reader makes it."""
    corners = np.array(list(points))
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in shrunk(corners, ENGINE_MARGIN_M).tolist()]
    lower, upper = ((x, y, z) for x, y, z in (corners.min(axis=0).tolist(), corners.max(axis=0).tolist()))
    return Shape("mesh", Pose(), None, lower, upper, "\n".join(["o hull_0", *lines, "f 1 2 3", ""]).encode())


def prism(corners: int, radius: float = 0.1, half_width: float = 0.02, squash: float = 1.0, off: float = 0.0) -> Shape:
    """A wheel about y with flat facets; `squash`: height over length; `off`: m, its centre ahead of the axis."""
    angles = [2 * math.pi * number / corners for number in range(corners)]
    return mesh(
        (off + radius * math.cos(angle), side, squash * radius * math.sin(angle))
        for angle in angles
        for side in (-half_width, half_width)
    )


def cylinder(radius: float, y: float = 0.0, length: float = 0.04) -> Shape:
    pose = dataclasses.replace(LYING, position_xyz=(0.0, y, 0.0))
    return Shape("cylinder", pose, radius, (-radius, -radius, -length / 2), (radius, radius, length / 2))


def sphere(radius: float, y: float = 0.0, x: float = 0.0) -> Shape:
    return Shape("sphere", Pose((x, y, 0.0)), radius, (-radius,) * 3, (radius,) * 3)


def box(half: float) -> Shape:
    return Shape("box", Pose(), None, (-half,) * 3, (half,) * 3)


def tyre(*shapes: Shape, joint: Joint = JOINT) -> Tyre | NotRound:
    return tyre_of(Link("wheel", 1.0, shapes), joint)


@pytest.mark.parametrize("corners", [8, 12, 32, 100])
def test_a_mesh_wheel_rolls_as_far_as_its_outline_is_long(corners: int) -> None:
    found = tyre(prism(corners))
    assert isinstance(found, Tyre)
    around = corners * 2 * 0.1 * math.sin(math.pi / corners)
    assert found.radius == pytest.approx(around / (2 * math.pi), rel=1e-6)
    assert found.width == pytest.approx(0.04)
    assert found.middle_xyz == pytest.approx((0, 0, 0), abs=1e-9)


@given(st.floats(-3, 3), st.floats(-1.5, 1.5), st.floats(-3, 3), st.integers(8, 40), st.floats(0.01, 2))
@examples(10)
def test_a_mesh_wheel_is_measured_about_any_axis(
    roll: float, pitch: float, yaw: float, corners: int, radius: float
) -> None:
    turned = quaternion_from_rpy(roll, pitch, yaw)
    shape = dataclasses.replace(prism(corners, radius), pose=Pose((0.3, -0.2, 0.1), turned))
    joint = dataclasses.replace(JOINT, axis_xyz=rotate(turned, ACROSS), anchor_xyz=(0.3, -0.2, 0.1))
    found = tyre(shape, joint=joint)
    assert isinstance(found, Tyre)
    assert found.radius == pytest.approx(corners * radius * math.sin(math.pi / corners) / math.pi, rel=1e-3)
    assert found.middle_xyz == pytest.approx((0.3, -0.2, 0.1), abs=1e-3 * radius)


@pytest.mark.parametrize("is_mjcf", [False, True])
def test_the_lowest_point_of_a_tilted_mesh_counts_not_its_box(is_mjcf: bool) -> None:
    # The box of an octahedron reaches 1.41 m down when it is tilted; the octahedron itself 0.71 m.
    points = [(sign * x, sign * y, sign * z) for x, y, z in np.eye(3).tolist() for sign in (-1.0, 1.0)]
    stated = Shape("mesh", Pose(), None, (-1.0,) * 3, (1.0,) * 3, corners=np.array(points, np.float32).tobytes())
    tilted = replace(stated if is_mjcf else mesh(points), pose=Pose((0, 0, 0), quaternion_from_rpy(math.pi / 4, 0, 0)))
    model = RobotModel("it", "", (Link("base", 1.0, (tilted, sphere(1.0))),), (), "")
    assert lowest_shape(model) == Lowest(-1.0, "base", "sphere")


def test_a_mesh_of_mjcf_has_its_corners() -> None:
    angles = np.arange(32) * (2 * np.pi / 32)
    rims = [np.stack([0.1 * np.cos(angles), np.full(32, y), 0.1 * np.sin(angles)], axis=1) for y in (0.0, 0.04)]
    corners = np.concatenate(rims).astype(np.float32).tobytes()
    found = tyre(Shape("mesh", Pose(), corners=corners))
    assert isinstance(found, Tyre)
    assert [found.radius, found.width] == pytest.approx([32 * 0.1 * math.sin(math.pi / 32) / math.pi, 0.04])
    assert found.middle_xyz == pytest.approx((0.0, 0.02, 0.0))


@pytest.mark.parametrize(
    ("shape", "reason"),
    [
        (prism(4), "its outline has 4 corners"),
        (prism(32, squash=0.9), "the corners of its outline are 0.09 m to 0.1 m from it"),
        (prism(32, off=0.01), "the corners of its outline are 0.09 m to 0.11 m from it"),
        (prism(7), "two corners of its outline are 51.4 deg apart"),
        (Shape("mesh", Pose()), "is a mesh whose shape is not known here"),
        (box(0.1), "is a box, which is not round"),
        (dataclasses.replace(cylinder(0.1), pose=Pose()), "is a cylinder, which does not lie along the joint's axis"),
        (sphere(0.1, x=0.01), "is a sphere, whose centre is 0.01 m from the joint's axis"),
    ],
    ids=[
        "square",
        "ellipse",
        "eccentric",
        "seven corners",
        "unknown",
        "box",
        "upright cylinder",
        "sphere off the axis",
    ],
)
def test_a_link_that_is_not_round_says_why(shape: Shape, reason: str) -> None:
    found = tyre(shape)
    assert isinstance(found, NotRound)
    assert found.reason.endswith(reason)


def test_the_largest_of_several_shapes_is_the_tyre_unless_another_sticks_out() -> None:
    assert tyre(cylinder(0.03, length=0.2), cylinder(0.1), box(0.05)) == tyre(cylinder(0.1))
    assert isinstance(tyre(cylinder(0.1), box(0.09)), NotRound)
    # Twin tyres are as wide as both.
    found = tyre(cylinder(0.1, y=0.05), cylinder(0.1, y=-0.01))
    assert isinstance(found, Tyre)
    assert [found.radius, found.width] == pytest.approx([0.1, 0.1])
    assert found.middle_xyz == pytest.approx((0, 0.02, 0))


def test_spheres_and_capsules_are_round() -> None:
    assert tyre(sphere(0.05)) == Tyre(0.05, (0.0, 0.0, 0.0), 0.0, "sphere")
    capsule = Shape("capsule", LYING, 0.05, (-0.05, -0.05, -0.07), (0.05, 0.05, 0.07))
    found = tyre(capsule)
    assert isinstance(found, Tyre)
    assert [found.radius, found.width] == pytest.approx([0.05, 0.04])


def test_a_wheel_that_is_only_drawn_touches_nothing() -> None:
    seen = Link("wheel", 1.0, visuals=(Visual("cylinder", Pose()),))
    assert tyre_of(seen, JOINT) == NotRound("has no collision shape, only visuals: nothing of it touches the ground")
    assert tyre_of(Link("wheel", 1.0), JOINT) == NotRound("has no collision shape")
