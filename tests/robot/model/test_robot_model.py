"""What a robot model knows of itself."""

from __future__ import annotations

import dataclasses
import math
import pickle

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_model import Joint, JointType, Link, RobotModel, ball_angles, ball_joints


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


@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic", "fixed", "floating", "planar"])
def test_a_joint_moves_if_one_motor_could_move_it(kind: JointType) -> None:
    assert joint("a", kind, "b", "c").moves is (kind in {"revolute", "continuous", "prismatic"})


def test_moving_joints_keep_the_order_of_the_file() -> None:
    joints = (joint("b", "prismatic", "base", "upper"), joint("a", "continuous", "upper", "hand"))
    assert [j.name for j in dataclasses.replace(ARM, joints=joints).moving_joints] == ["b", "a"]


# --- ball joints ---

_PARTS, _BETWEEN = ball_joints("b", "base", "bob", Pose((0.0, 0.0, 1.0)), (0.1, 0.0, 0.0))
BALL = RobotModel(
    name="ball",
    source="/ball.urdf",
    links=(Link("base", 1.0), Link("bob", 1.0), Link("tip", 1.0), *_BETWEEN),
    joints=(*_PARTS, joint("hinge", "continuous", "bob", "tip")),
    urdf="<robot/>",
)


def test_the_rotations_of_a_ball_joint_come_after_the_joints_with_motors() -> None:
    assert [part.name for part in BALL.moving_joints] == ["hinge", "b_x", "b_y", "b_z"]
    assert [part.name for part in BALL.motor_joints] == ["hinge"]
    assert BALL.balls == ("b",)


@pytest.mark.parametrize("name", ["b", "b_x", "b_z"])
def test_a_ball_joint_cannot_be_commanded(name: str) -> None:
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
