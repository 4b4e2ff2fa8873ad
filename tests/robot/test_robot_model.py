"""What a robot model knows of itself."""

from __future__ import annotations

import dataclasses
import pickle

import pytest

from sim_action.core.geometry import Pose
from sim_action.robot.robot_model import Joint, JointType, Link, RobotModel


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


def test_the_root_is_the_link_that_is_no_child() -> None:
    assert ARM.root == "base"


def test_links_without_a_mass_weigh_nothing() -> None:
    assert ARM.mass == 3.5


def test_parts_are_found_by_name() -> None:
    assert ARM.links_by_name["upper"].mass == 1.5
    assert ARM.joints_by_name["wrist"].child == "hand"


@pytest.mark.parametrize(
    ("kind", "moves"),
    [
        ("revolute", True),
        ("continuous", True),
        ("prismatic", True),
        ("fixed", False),
        ("floating", False),
        ("planar", False),
    ],
)
def test_a_joint_moves_if_one_motor_could_move_it(kind: JointType, moves: bool) -> None:
    assert joint("a", kind, "b", "c").moves is moves


def test_moving_joints_keep_the_order_of_the_file() -> None:
    joints = (joint("b", "prismatic", "base", "upper"), joint("a", "continuous", "upper", "hand"))
    assert [j.name for j in dataclasses.replace(ARM, joints=joints).moving_joints] == ["b", "a"]


def test_a_model_survives_pickling() -> None:
    assert pickle.loads(pickle.dumps(ARM)) == ARM
