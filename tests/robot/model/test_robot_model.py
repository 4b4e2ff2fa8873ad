"""What a robot model knows of itself, and which of its links may touch each other."""

from __future__ import annotations

import dataclasses
import math
import pickle
from pathlib import Path

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from sim_action.core import geometry
from sim_action.core.errors import InvalidPart
from sim_action.core.geometry import Pose
from sim_action.core.workspace import Workspace
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_model import (
    Joint,
    JointType,
    Link,
    RobotModel,
    ball_angles,
    ball_joints,
    has_limb,
    touchable_pairs,
    unwatched_note,
)
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model


def joint(name: str, kind: JointType, parent: str, child: str) -> Joint:
    return Joint(name, kind, parent, child, Pose(), (0.0, 0.0, 1.0))


ARM = RobotModel(
    name="arm",
    source="/arm.urdf",
    # The root is not the first.
    links=(Link("hand", None), Link("base", 2.0), Link("upper", 1.5)),
    joints=(joint("shoulder", "revolute", "base", "upper"), joint("wrist", "fixed", "upper", "hand")),
    urdf="<robot/>",
)


def test_a_model_has_a_root_a_mass_and_parts_by_name_and_survives_pickling() -> None:
    assert (ARM.root, ARM.mass) == ("base", 3.5)
    assert (ARM.links_by_name["upper"].mass, ARM.joints_by_name["wrist"].child) == (1.5, "hand")
    assert pickle.loads(pickle.dumps(ARM)) == ARM
    # Moving joints keep the order of the file.
    joints = (joint("b", "prismatic", "base", "upper"), joint("a", "continuous", "upper", "hand"))
    assert [j.name for j in dataclasses.replace(ARM, joints=joints).moving_joints] == ["b", "a"]


@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic", "fixed", "floating", "planar"])
def test_a_joint_moves_if_one_motor_could_move_it(kind: JointType) -> None:
    assert joint("a", kind, "b", "c").moves is (kind in {"revolute", "continuous", "prismatic"})


_PARTS, _BETWEEN = ball_joints("b", "base", "bob", Pose((0.0, 0.0, 1.0)), (0.1, 0.0, 0.0))
BALL = RobotModel(
    name="ball",
    source="/ball.urdf",
    links=(Link("base", 1.0), Link("bob", 1.0), Link("tip", 1.0), *_BETWEEN),
    joints=(*_PARTS, joint("hinge", "continuous", "bob", "tip")),
    urdf="<robot/>",
)


def test_the_rotations_of_a_ball_joint_come_after_the_joints_with_motors_and_cannot_be_commanded() -> None:
    assert [part.name for part in BALL.moving_joints] == ["hinge", "b_x", "b_y", "b_z"]
    assert [part.name for part in BALL.motor_joints] == ["hinge"]
    assert BALL.balls == ("b",)
    for name in ("b", "b_x", "b_z"):
        assert BALL.why_not_driven(name) == "joint 'b' is a ball joint: it swings freely and has no motor"
    assert BALL.why_not_driven("hinge") is None


@given(*[st.floats(-1, 1)] * 4)
@example(0.5, 0.5, 0.5, 0.5)
@example(0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5))
@example(0.0, -math.sqrt(0.5), 0.0, math.sqrt(0.5))
@example(0.3, math.sqrt(0.5), 0.3, math.sqrt(0.5) + 1e-8)
def test_the_angles_of_a_ball_joint_turn_its_link_as_its_orientation(x: float, y: float, z: float, w: float) -> None:
    length = math.hypot(x, y, z, w)
    assume(length > 0.1)
    orientation = (x / length, y / length, z / length, w / length)
    positions = dict(zip(("b_x", "b_y", "b_z"), ball_angles(orientation), strict=True))
    at = link_poses(BALL, positions)["bob"]
    for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)):
        turned = geometry.rotate(orientation, axis)
        assert geometry.rotate(at.orientation_xyzw, axis) == pytest.approx(turned, abs=1e-5)
    # It turns about the anchor.
    anchor = geometry.compose(at, Pose((0.1, 0.0, 0.0))).position_xyz
    assert anchor == pytest.approx((0.1, 0.0, 1.0), abs=1e-9)


BOX = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'


def chain(folder: Path, *kinds: str) -> RobotModel:
    """A base `l0`, and a link below each joint of these types."""
    links = "".join(f'<link name="l{number}">{BOX}</link>' for number in range(len(kinds) + 1))
    joints = "".join(
        f'<joint name="j{number}" type="{kind}"><parent link="l{number}"/><child link="l{number + 1}"/>'
        '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        for number, kind in enumerate(kinds)
    )
    (folder / "chain.urdf").write_text(f'<robot name="chain">{links}{joints}</robot>')
    return load_model(Robot(model="chain.urdf", base="fixed"), Workspace(folder, folder))


@pytest.mark.parametrize(
    ("kinds", "pairs"),
    [
        (("revolute",), []),
        (("revolute", "revolute"), [("l0", "l2")]),
        (("revolute", "fixed"), []),
        (("fixed", "revolute", "fixed"), []),
        (("revolute", "fixed", "prismatic"), [("l0", "l3")]),
        (("planar", "revolute"), [("l0", "l2")]),
        (("floating", "revolute"), [("l0", "l2")]),
    ],
)
def test_links_of_one_body_and_neighbours_cannot_touch(
    kinds: tuple[str, ...], pairs: list[tuple[str, str]], tmp_path: Path
) -> None:
    assert list(touchable_pairs(chain(tmp_path, *kinds))) == pairs


@pytest.mark.parametrize(
    ("kinds", "bolted", "free"),
    [
        (("revolute",), False, False),
        (("revolute", "revolute"), True, False),
        (("revolute", "prismatic", "revolute"), True, True),
        (("revolute", "continuous"), False, False),
        (("continuous", "continuous", "fixed"), True, False),
    ],
)
def test_an_arm_or_a_leg_has_several_motors_in_a_row(
    kinds: tuple[str, ...], bolted: bool, free: bool, tmp_path: Path
) -> None:
    model = chain(tmp_path, *kinds)
    assert (has_limb(model, bolted=True), has_limb(model, bolted=False)) == (bolted, free)


@pytest.mark.parametrize(("name", "noted"), [("ur5e_gripper", True), ("turtlebot3_burger", False), ("f1tenth", False)])
def test_only_robots_with_limbs_get_a_note_if_the_scenario_leaves_it_open(name: str, noted: bool) -> None:
    here = Workspace(Path("/"), Path("/"))
    left_open = Robot(model=name)
    model = load_model(left_open, here)
    assert (unwatched_note(model, left_open, bolted=noted) is not None) == noted
    assert unwatched_note(model, Robot(model=name, self_collision=False), bolted=noted) is None


def test_mjcf_excludes_pairs(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    geom = '<geom type="box" size="0.1 0.1 0.1"/>'
    joint = '<joint type="hinge" axis="0 0 1" range="-1 1"/>'
    body = f'<body name="a">{geom}<body name="b">{joint}{geom}<body name="c">{joint}{geom}'
    body += f'<body name="d">{joint}{geom}</body></body></body></body>'
    contact = '<contact><exclude body1="d" body2="a"/></contact>'
    (tmp_path / "m.xml").write_text(f'<mujoco model="m"><worldbody>{body}</worldbody>{contact}</mujoco>')
    model = load_model(Robot(model="m.xml"), Workspace(tmp_path, tmp_path))
    assert list(touchable_pairs(model)) == [("a", "c"), ("b", "d")]


def test_arguments_are_for_a_xacro_file_only() -> None:
    assert Robot(model="arm.urdf.xacro", args={"size": 2}).args == {"size": 2}
    with pytest.raises(InvalidPart, match=r"only a \.xacro file has arguments, and the model is 'arm\.urdf'"):
        Robot(model="arm.urdf", args={"size": 2})
