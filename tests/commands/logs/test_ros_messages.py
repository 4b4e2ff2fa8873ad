"""What messages of ROS tell a robot."""

from __future__ import annotations

from typing import Any, get_args

import pytest
from rosbags.typesys.store import Typestore

from sim_action.commands.logs.rosbag import TWISTS, TYPES, MessageError, MessageType, command_of
from sim_action.core.geometry import Twist
from sim_action.state.command import JointTargets
from tests.commands.logs.bags import JOINTS, ROS1, ROS2, STAMPED, TWIST, joint_state, stamped, twist

both_generations = pytest.mark.parametrize("store", [ROS1, ROS2], ids=["ros1", "ros2"])


def test_every_type_that_a_scenario_can_name_is_read() -> None:
    assert set(get_args(MessageType)) == set(TYPES)
    assert set(TYPES) > TWISTS


@both_generations
def test_twists_with_and_without_a_stamp(store: Typestore) -> None:
    assert command_of(TWIST, twist(store, 1.0, 2.0)) == Twist.planar(1.0, 2.0)
    assert command_of(STAMPED, stamped(store, 1.0, 2.0)) == Twist.planar(1.0, 2.0)


@both_generations
def test_a_joint_state_says_where_to_go_and_else_how_fast(store: Typestore) -> None:
    message = joint_state(store, ["a", "b"], position=[1, 2], velocity=[3, 4], effort=[float("nan")] * 2)
    assert command_of(JOINTS, message) == JointTargets(position={"a": 1.0, "b": 2.0})
    assert command_of(JOINTS, joint_state(store, ["a"], velocity=[3], effort=[5])) == JointTargets(velocity={"a": 3.0})
    assert command_of(JOINTS, joint_state(store, ["a"], effort=[5])) == JointTargets(effort={"a": 5.0})


@pytest.mark.parametrize(
    ("message", "what"),
    [
        (twist(ROS2, float("nan"), 0.0), "not finite"),
        (joint_state(ROS2, ["a"], position=[float("inf")]), "not finite"),
        (joint_state(ROS2, ["a", "b"], position=[1.0]), "2 names, and 1 numbers in 'position'"),
        (joint_state(ROS2, ["a"], position=[1.0], effort=[1.0, 2.0]), "1 names, and 2 numbers in 'effort'"),
        (joint_state(ROS2, ["a"]), "no position, no velocity and no effort"),
        (joint_state(ROS2, ["a", "a"], position=[1.0, 2.0]), "named twice"),
    ],
)
def test_a_message_that_no_robot_can_be_told_is_refused(message: Any, what: str) -> None:
    type_name = message.__msgtype__
    with pytest.raises(MessageError, match=what):
        command_of(type_name, message)
