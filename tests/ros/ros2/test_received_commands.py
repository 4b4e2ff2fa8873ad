"""Commands from topics: the type and the quality that publishers have, several publishers, and bad twists."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from sim_action.core.errors import ScriptError
from sim_action.core.geometry import Twist
from sim_action.core.records import dataclass
from sim_action.robot.model.robot_model import Joint
from sim_action.ros.ros2.joint_controllers import any_joints_subscription
from sim_action.ros.ros2.messages import Message, vector
from sim_action.ros.ros2.quality import LATCHED, TRANSFORMS, USUAL, Qos, large_message_problem, subscriber_problems
from sim_action.ros.ros2.received_commands import ReceivedCommands, twist_subscription
from sim_action.state.command import JointTargets
from tests.ros.ros2.scenes import moment

TWIST, STAMPED, TEXT = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped", "std_msgs/msg/String"
DRIVE = twist_subscription("cmd_vel", "/cmd_vel")


@dataclass(frozen=True)
class End:
    node: str = "/mover"
    type: str = TWIST
    reliability: str = "reliable"
    durability: str = "volatile"
    demands: tuple[str, ...] = ()


def twist(x: float = 0.3, turn: float = 0.2) -> Message:
    return {"linear": vector((x, 0.0, 0.0)), "angular": vector((0.0, 0.0, turn))}


@pytest.mark.parametrize("kind", [TWIST, STAMPED])
def test_a_subscription_has_the_type_of_its_publisher(kind: str) -> None:
    found = DRIVE.matched([End(type=kind)])

    assert (found.type, found.qos) == (kind, USUAL)
    assert set(found.types) == {TWIST, STAMPED}


def test_without_a_publisher_it_takes_twists() -> None:
    assert DRIVE.matched([]) == DRIVE
    assert DRIVE.type == TWIST


def test_it_also_hears_best_effort_publishers() -> None:
    found = DRIVE.matched([End(reliability="best_effort", type=STAMPED)])
    assert (found.type, found.qos.reliability) == (STAMPED, "best_effort")


WRONG_TYPE = (
    f"'/mover' publishes /cmd_vel as {TEXT}, but the robot takes {TWIST} or {STAMPED}; to leave this topic to others, "
    "give the robot another one with topics: {cmd_vel: ...}"
)
SEVERAL = (
    "2 nodes publish /cmd_vel, which commands the robot: /joystick, /mover; let one node choose between them, or give "
    "the others other topics"
)


@pytest.mark.parametrize(
    ("publishers", "message"),
    [
        ([End(type=TEXT)], WRONG_TYPE),
        ([End(type=TWIST), End(type=STAMPED)], f"'/mover' publishes /cmd_vel with several types: {TWIST}, {STAMPED}"),
        ([End(), End("/joystick")], SEVERAL),
    ],
)
def test_publishers_that_cannot_command_the_robot_are_named(publishers: list[End], message: str) -> None:
    with pytest.raises(ScriptError) as raised:
        DRIVE.matched(publishers)
    assert str(raised.value) == message


def test_the_last_twist_holds() -> None:
    commands = ReceivedCommands([DRIVE])
    assert commands.answer(moment()) is None

    commands.take("/cmd_vel", twist(0.1), "/mover", moment())
    commands.take("/cmd_vel", {"header": {}, "twist": twist(0.4)}, "/mover", moment())
    assert commands.answer(moment(0.1)) == Twist.planar(0.4, 0.2)
    assert commands.answer(moment(0.2)) == Twist.planar(0.4, 0.2)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_twist_that_is_not_finite_names_node_and_topic(bad: float) -> None:
    commands = ReceivedCommands([DRIVE])

    with pytest.raises(ScriptError, match=r"'/mover' sent a bad command on /cmd_vel: .* not finite"):
        commands.take("/cmd_vel", twist(bad), "/mover", moment())


def test_a_base_and_its_joints_are_commanded_together() -> None:
    joint = Joint("a", "revolute", "base", "a", moment().pose, (0.0, 0.0, 1.0))
    commands = ReceivedCommands([DRIVE, any_joints_subscription("joint_trajectory", "/joint_trajectory", [joint])])
    seen = moment(joints={"a": 0.0})
    points = [{"positions": [1.0], "velocities": [], "accelerations": [], "time_from_start": {"sec": 1, "nanosec": 0}}]
    trajectory = {"header": {"stamp": {"sec": 0, "nanosec": 0}}, "joint_names": ["a"], "points": points}

    commands.take("/cmd_vel", twist(), "/mover", seen)
    commands.take("/joint_trajectory", trajectory, "/arm", seen)
    answer = commands.answer(moment(0.5, joints={"a": 0.0}))
    assert isinstance(answer, tuple)
    base, joints = answer
    assert base == Twist.planar(0.3, 0.2)
    assert isinstance(joints, JointTargets)
    assert (joints.position, joints.velocity) == ({"a": 0.5}, {"a": 1.0})


@pytest.mark.parametrize(
    ("offered", "end", "problem"),
    [
        (USUAL, End(), None),
        (USUAL, End(reliability="best_effort"), None),
        (LATCHED, End(durability="transient_local"), None),
        (LATCHED, End(), None),
        (TRANSFORMS, End(), None),
        (USUAL, End(type=TEXT), "as std_msgs/msg/String, but the robot publishes geometry_msgs/msg/Twist"),
        (USUAL, End(durability="transient_local"), "so that they do not connect; subscribe with volatile"),
        (USUAL, End(demands=("a deadline", "a liveliness")), "with a deadline and a liveliness, which the robot does"),
        (Qos("best_effort"), End(), "so that they do not connect; subscribe with best_effort"),
    ],
)
def test_subscribers_that_cannot_connect_are_named(offered: Qos, end: End, problem: str | None) -> None:
    found = list(subscriber_problems("/topic", TWIST, offered, [end]))

    assert len(found) == (problem is not None)
    assert all(each.startswith("'/mover' subscribes to /topic") and str(problem) in each for each in found)


def test_messages_that_the_system_does_not_buffer_are_named(tmp_path: Path) -> None:
    limit = tmp_path / "rmem_max"
    limit.write_text("212992\n")
    assert large_message_problem("/image", 200_000, limit) is None
    assert "sudo sysctl -w net.core.rmem_max=4194304" in str(large_message_problem("/image", 921_600, limit))
    limit.write_text("4194304\n")
    assert large_message_problem("/image", 921_600, limit) is None
    assert str(large_message_problem("/image", 6_220_800, limit)).endswith("make the messages smaller")
    assert large_message_problem("/image", 921_600, tmp_path / "missing") is None
