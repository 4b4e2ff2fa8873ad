"""Frames of models and links: rigid bodies move as one, and links with their joints."""

from __future__ import annotations

import math

import pytest

from sim_action.core.geometry import Pose, Twist, quaternion_from_rpy
from sim_action.robot.model.robot_model import Joint, Link, RobotModel
from sim_action.ros.ros1.node.current_state import ModelFrame, link_state, twist_at
from sim_action.state.observation import JointState

HINGE = Joint("hinge", "continuous", "base", "arm", Pose((0.0, 0.0, 1.0)), (0.0, 0.0, 1.0))
TIP = Joint("tip", "fixed", "arm", "hand", Pose((2.0, 0.0, 0.0)), (0.0, 0.0, 1.0))
MODEL = RobotModel("m", "", (Link("base", 1.0), Link("arm", 1.0), Link("hand", 1.0)), (HINGE, TIP), "")


def test_a_model_whose_base_link_is_not_at_its_origin() -> None:
    frame = ModelFrame(Pose((1.0, 0.0, 0.2)))
    turned = Pose((0.0, 0.0, 0.2), quaternion_from_rpy(0, 0, math.pi / 2))

    assert frame.pose(turned).position_xyz == pytest.approx((0, -1, 0))
    assert frame.base_pose(frame.pose(turned)).position_xyz == pytest.approx(turned.position_xyz)
    # The origin goes around the base link at a radius of 1 m.
    assert frame.twist(turned, Twist((0.0, 0.0, 0.0), (0.0, 0.0, 2.0))).linear_xyz == pytest.approx((2, 0, 0))


def test_a_point_away_from_what_turns_goes_around_it() -> None:
    twist = Twist((1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert twist_at(twist, (0.0, 3.0, 0.0)).linear_xyz == pytest.approx((-2, 0, 0))


def test_a_link_moves_with_the_base_and_with_its_joint() -> None:
    base = Pose((5.0, 0.0, 0.0), quaternion_from_rpy(0, 0, math.pi / 2)), Twist((0.1, 0.0, 0.0), (0.0, 0.0, 1.0))
    joints = {"hinge": JointState(math.pi / 2, 3.0, 0.0)}

    pose, twist = link_state(MODEL, base, joints, "hand")

    assert pose.position_xyz == pytest.approx((3, 0, 1))
    assert pose.yaw == pytest.approx(math.pi)
    assert twist.angular_xyz == pytest.approx((0, 0, 4), abs=1e-5)
    assert twist.linear_xyz == pytest.approx((0.1, -8, 0), abs=1e-4)


def test_a_link_that_there_is_not() -> None:
    with pytest.raises(KeyError):
        link_state(MODEL, (Pose(), Twist()), {}, "foot")
