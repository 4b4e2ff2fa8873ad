"""Commands from topics: the type and the quality that publishers have, several publishers, and bad twists."""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from sim_action.core.errors import ScriptError
from sim_action.core.geometry import Pose, Twist
from sim_action.robot.model.robot_model import Joint
from sim_action.ros.joint_commands import TrajectoryPoint, Waypoint, joint_curves
from sim_action.ros.messages import Message, vector
from sim_action.ros.ros2 import graph, received_commands
from sim_action.ros.ros2.spec import JointController
from sim_action.ros.ros2.topics import channels, controller_problems, topics_of
from sim_action.state.command import JointTargets
from tests.ros.ros2.scenes import ARM, moment, resting, scene

TWIST, STAMPED, TEXT = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped", "std_msgs/msg/String"
DRIVE = received_commands.twist_subscription("cmd_vel", "/cmd_vel")

end = partial(graph.TopicEnd, node="/mover", type=TWIST, reliability="reliable", durability="volatile", demands=())


def twist(x: float = 0.3, turn: float = 0.2) -> Message:
    return {"linear": vector((x, 0.0, 0.0)), "angular": vector((0.0, 0.0, turn))}


def test_a_subscription_has_the_type_and_the_reliability_of_its_publisher() -> None:
    assert DRIVE.matched([]) == DRIVE
    for kind in (TWIST, STAMPED):
        found = DRIVE.matched([end(type=kind)])
        assert (found.type, found.qos, set(found.types)) == (kind, graph.USUAL, {TWIST, STAMPED})
    found = DRIVE.matched([end(reliability="best_effort", type=STAMPED)])
    assert (DRIVE.type, found.type, found.qos.reliability) == (TWIST, STAMPED, "best_effort")


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
        ([end(type=TEXT)], WRONG_TYPE),
        ([end(type=TWIST), end(type=STAMPED)], f"'/mover' publishes /cmd_vel with several types: {TWIST}, {STAMPED}"),
        ([end(), end(node="/joystick")], SEVERAL),
    ],
)
def test_publishers_that_cannot_command_the_robot_are_named(publishers: list[graph.TopicEnd], message: str) -> None:
    with pytest.raises(ScriptError) as raised:
        DRIVE.matched(publishers)
    assert str(raised.value) == message


def test_the_last_twist_holds() -> None:
    commands = received_commands.ReceivedCommands([DRIVE])
    assert commands.answer(moment()) is None
    commands.take("/cmd_vel", twist(0.1), "/mover", moment())
    commands.take("/cmd_vel", {"header": {}, "twist": twist(0.4)}, "/mover", moment())
    assert commands.answer(moment(0.1)) == Twist.planar(0.4, 0.2)
    assert commands.answer(moment(0.2)) == Twist.planar(0.4, 0.2)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_twist_that_is_not_finite_names_node_and_topic(bad: float) -> None:
    commands = received_commands.ReceivedCommands([DRIVE])
    with pytest.raises(ScriptError, match=r"'/mover' sent a bad command on /cmd_vel: .* not finite"):
        commands.take("/cmd_vel", twist(bad), "/mover", moment())


def test_a_base_and_its_joints_are_commanded_together() -> None:
    joint = Joint("a", "revolute", "base", "a", moment().pose, (0.0, 0.0, 1.0))
    commands = received_commands.ReceivedCommands(
        [DRIVE, received_commands.any_joints_subscription("joint_trajectory", "/joint_trajectory", [joint])]
    )
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
    # Two ramps of 20 ms are part of the second.
    assert joints.position == pytest.approx({"a": 0.5})
    assert joints.velocity == pytest.approx({"a": 1 / 0.98})


@pytest.mark.parametrize(
    ("offered", "subscriber", "problem"),
    [
        (graph.USUAL, end(), None),
        (graph.USUAL, end(reliability="best_effort"), None),
        (graph.LATCHED, end(durability="transient_local"), None),
        (graph.LATCHED, end(), None),
        (graph.TRANSFORMS, end(), None),
        (graph.USUAL, end(type=TEXT), "as std_msgs/msg/String, but the robot publishes geometry_msgs/msg/Twist"),
        (graph.USUAL, end(durability="transient_local"), "so that they do not connect; subscribe with volatile"),
        (graph.USUAL, end(demands=("a deadline", "a liveliness")), "with a deadline and a liveliness, which the robot"),
        (graph.Qos("best_effort"), end(), "so that they do not connect; subscribe with best_effort"),
    ],
)
def test_subscribers_that_cannot_connect_are_named(
    offered: graph.Qos, subscriber: graph.TopicEnd, problem: str | None
) -> None:
    found = list(graph.subscriber_problems("/topic", TWIST, offered, [subscriber]))
    assert len(found) == (problem is not None)
    assert all(each.startswith("'/mover' subscribes to /topic") and str(problem) in each for each in found)


def test_messages_that_the_system_does_not_buffer_are_named(tmp_path: Path) -> None:
    limit = tmp_path / "rmem_max"
    limit.write_text("212992\n")
    assert graph.large_message_problem("/image", 200_000, limit) is None
    assert "sudo sysctl -w net.core.rmem_max=4194304" in str(graph.large_message_problem("/image", 921_600, limit))
    limit.write_text("4194304\n")
    assert graph.large_message_problem("/image", 921_600, limit) is None
    assert str(graph.large_message_problem("/image", 6_220_800, limit)).endswith("make the messages smaller")
    assert graph.large_message_problem("/image", 921_600, tmp_path / "missing") is None


def joint(name: str, limit: float | None = None) -> Joint:
    lower = None if limit is None else -limit
    return Joint(name, "revolute", "base", name, Pose(), (0.0, 0.0, 1.0), lower, limit, max_velocity=limit)


def duration(seconds: float) -> Message:
    return {"sec": math.floor(seconds), "nanosec": round(seconds % 1 * 1e9)}


def point(at: float, positions: Sequence[float], *more: Sequence[float]) -> Message:
    names = ("positions", "velocities", "accelerations", "effort")
    stated = zip_longest(names, (positions, *more), fillvalue=())
    return {**{str(name): array("d", values) for name, values in stated}, "time_from_start": duration(at)}


def trajectory(names: Sequence[str], *points: Message, stamp: float = 0.0) -> Message:
    return {"header": {"stamp": duration(stamp), "frame_id": ""}, "joint_names": list(names), "points": list(points)}


AT_REST = moment(2.0, joints={"a": 0.5, "b": -0.5})


def receiver(*, needs_all: bool = True) -> received_commands.TrajectoryReceiver:
    return received_commands.TrajectoryReceiver([joint("a"), joint("b")], needs_all=needs_all)


def answered(it: received_commands.TrajectoryReceiver, time: float) -> JointTargets:
    targets = it.answer(moment(time, joints={"a": 0.5, "b": -0.5}))
    assert targets is not None
    return targets


numbers = st.floats(-2, 2)
triples = st.lists(st.tuples(numbers, numbers), min_size=3, max_size=3)


@given(values=st.lists(triples, min_size=1, max_size=4), degree=st.sampled_from([1, 3, 5]), share=st.floats(0, 5))
def test_trajectories_are_followed_as_in_ros_1(
    values: list[list[tuple[float, float]]], degree: int, share: float
) -> None:
    groups = {1: 1, 3: 2, 5: 3}[degree]
    stated = [group[:groups] for group in values]
    points = [point(0.5 * (number + 1), *group) for number, group in enumerate(stated)]
    ours = receiver(needs_all=False)
    ours.take(trajectory(["b", "a"], *points), AT_REST)
    start = [Waypoint(2.0, -0.5, 0.0, 0.0), Waypoint(2.0, 0.5, 0.0, 0.0)]
    timed = [TrajectoryPoint(2.0 + 0.5 * (number + 1), *group) for number, group in enumerate(stated)]
    theirs = joint_curves(["b", "a"], start, timed)
    time = 2.0 + 0.5 * share
    found = answered(ours, time)
    assert (dict(found.position), dict(found.velocity)) == (
        {name: curve.at(time)[0] for name, curve in theirs.items()},
        {name: curve.at(time)[1] for name, curve in theirs.items()},
    )


def test_a_controller_holds_its_joints_before_and_after_a_trajectory() -> None:
    it = receiver()
    assert answered(it, 0.0).position == {"a": 0.5, "b": -0.5}
    it.take(trajectory(["a", "b"], point(1.0, [1.0, 1.0])), AT_REST)
    assert answered(it, 2.5).position == pytest.approx({"a": 0.75, "b": 0.25})
    assert answered(it, 9.0).position == {"a": 1.0, "b": 1.0}
    assert answered(it, 9.0).velocity == {"a": 0.0, "b": 0.0}


def test_joints_that_no_trajectory_names_are_left_as_they_are() -> None:
    it = receiver(needs_all=False)
    assert it.answer(AT_REST) is None
    it.take(trajectory(["b"], point(1.0, [0.5])), AT_REST)
    assert answered(it, 2.5).position == {"b": 0.0}


def test_a_new_trajectory_starts_from_the_present_state_of_the_last_one() -> None:
    it = receiver(needs_all=False)
    it.take(trajectory(["a"], point(1.0, [1.5], [0.0])), AT_REST)
    before = answered(it, 2.5)
    it.take(trajectory(["a"], point(1.0, [0.0], [0.0])), moment(2.5, joints={"a": 9.0, "b": 0.0}))
    assert answered(it, 2.5).position == before.position
    assert answered(it, 2.5 + 1e-6).velocity["a"] == pytest.approx(before.velocity["a"], abs=1e-4)


def test_a_stamp_sets_the_start_and_a_trajectory_that_has_begun_goes_on_from_its_own_points() -> None:
    it = receiver(needs_all=False)
    it.take(trajectory(["a"], point(1.0, [1.5]), stamp=5.0), AT_REST)
    assert answered(it, 4.0).position["a"] == pytest.approx(1.0)
    it.take(trajectory(["a"], point(0.0, [3.0]), point(2.0, [5.0]), stamp=1.0), AT_REST)
    assert answered(it, 2.5).position["a"] == pytest.approx(4.5, abs=0.01)
    # A point at the start is reached at once.
    it = receiver(needs_all=False)
    it.take(trajectory(["a"], point(0.0, [1.0])), AT_REST)
    assert answered(it, 2.0).position == {"a": 1.0}


def test_targets_stay_within_the_limits_of_joints() -> None:
    it = received_commands.TrajectoryReceiver([joint("a", 1.0)])
    it.take(trajectory(["a"], point(0.1, [7.0])), AT_REST)
    assert answered(it, 2.05).position == {"a": 1.0}
    assert answered(it, 2.05).velocity == {"a": 1.0}


NAN = math.nan


@pytest.mark.parametrize(
    ("message", "problem"),
    [
        (trajectory([], point(1.0, [])), "a trajectory without joint_names"),
        (trajectory(["a", "b"]), "a trajectory without points"),
        (trajectory(["a", "bb"], point(1.0, [0.0, 0.0])), "unknown joint 'bb'; did you mean 'b'?"),
        (trajectory(["a"], point(1.0, [0.0])), "a trajectory without b; it needs all joints of the controller"),
        (trajectory(["a", "b", "a"], point(1.0, [0.0] * 3)), "a joint twice in joint_names: a, b, a"),
        (trajectory(["a", "b"], point(1.0, [0.0])), "points[0] has 1 positions for 2 joints"),
        (trajectory(["a", "b"], point(1.0, [])), "points[0] has no positions"),
        (trajectory(["a", "b"], point(1.0, [], [0.0, 0.0])), "points[0] has no positions"),
        (trajectory(["a", "b"], point(1.0, [0.0, 0.0], [1.0])), "points[0] has 1 velocities for 2 joints"),
        (trajectory(["a", "b"], point(1.0, [0.0, NAN])), "points[0].positions[1] is nan, which is not finite"),
        (trajectory(["a", "b"], point(1.0, [0.0] * 2, [0.0] * 2, [0.0, math.inf])), "accelerations[1] is inf"),
        (trajectory(["a", "b"], point(1.0, [0.0] * 2, [], [], [1.0] * 2)), "points[0] has efforts"),
        (
            trajectory(["a", "b"], *[point(1.0, [0.0] * 2)] * 2),
            "[1] is at 1 s, not later than the point before, at 1 s",
        ),
        (trajectory(["a", "b"], point(0.5, [0.0] * 2), stamp=1.0), "ended at 1.5 s, before the present, 2 s"),
        (trajectory(["a", "b"], point(1.0, [0.0] * 2, [0.0, 0.5])), "joint 'b' has the velocity 0.5"),
    ],
)
def test_trajectories_that_a_controller_refuses(message: Message, problem: str) -> None:
    it = receiver()
    with pytest.raises(received_commands.BadMessage) as raised:
        it.take(message, AT_REST)
    assert problem in str(raised.value)
    assert answered(it, 2.0).position == {"a": 0.5, "b": -0.5}


@pytest.mark.parametrize(
    ("reading", "before", "after"),
    [
        ("position", {"a": 0.5, "b": -0.5}, {"a": 1.0, "b": -0.25}),
        ("velocity", {"a": 0.0, "b": 0.0}, {"a": 1.0, "b": -0.25}),
        ("effort", None, {"a": 3.0, "b": -0.25}),
    ],
)
def test_values_are_passed_on_within_limits(reading: Any, before: dict[str, float] | None, after: Any) -> None:
    it = received_commands.ValuesReceiver([joint("a", 1.0), joint("b", 1.0)], reading)
    held = it.answer(AT_REST)
    assert (None if held is None else getattr(held, reading)) == before
    it.take({"layout": {}, "data": array("d", [3.0, -0.25])}, AT_REST)
    found = it.answer(AT_REST)
    assert found is not None
    assert getattr(found, reading) == after


@pytest.mark.parametrize(
    ("data", "problem"),
    [([1.0], "1 values in data for 2 joints: a, b"), ([1.0, NAN], "data[1] is nan, which is not finite")],
)
def test_values_that_cannot_be(data: list[float], problem: str) -> None:
    it = received_commands.ValuesReceiver([joint("a"), joint("b")], "position")
    with pytest.raises(received_commands.BadMessage) as raised:
        it.take({"data": array("d", data)}, AT_REST)
    assert problem in str(raised.value)


def test_controllers_have_the_topics_of_ros2_control(tmp_path: Path) -> None:
    there = scene(tmp_path, ARM, robot=", base: fixed")
    arm = JointController(trajectory=("shoulder_*", "elbow_joint"))
    wrist = JointController(position=("wrist_2_joint", "wrist_1_joint"))
    controllers = {"arm_controller": arm, "wrist": wrist}
    found = {each.topic: each for each in channels(there, {"wrist": "/w"}, 100.0, controllers).subscriptions}
    assert {topic: each.type for topic, each in found.items()} == {
        "/arm_controller/joint_trajectory": "trajectory_msgs/msg/JointTrajectory",
        "/w": "std_msgs/msg/Float64MultiArray",
    }
    assert arm.joints(there.model) == ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint")
    assert not list(controller_problems(there, controllers))
    commands = received_commands.ReceivedCommands(found.values())
    commands.take("/w", {"data": array("d", [0.1, 0.2])}, "/node", resting(there))
    answer = commands.answer(resting(there))
    assert isinstance(answer, JointTargets)
    assert answer.position["wrist_2_joint"] == 0.1
    assert answer.position["elbow_joint"] == there.joint_positions["elbow_joint"]


def test_without_controllers_any_joint_follows_trajectories_except_those_of_the_drive(tmp_path: Path) -> None:
    arm = scene(tmp_path, ARM, robot=", base: fixed")
    (subscription,) = channels(arm, {}, 100.0).subscriptions
    assert subscription.topic == "/joint_trajectory"
    assert topics_of(arm, {"joint_trajectory": "/arm/joint_trajectory"})["joint_trajectory"] == "/arm/joint_trajectory"
    assert "joint_trajectory" not in topics_of(scene(tmp_path), {})


def test_controllers_that_do_not_fit_the_robot_are_named(tmp_path: Path) -> None:
    there = scene(tmp_path, ARM, robot=", base: fixed")
    controllers = {
        "joint_states": JointController(velocity=("wrist_1_joint",)),
        "arm": JointController(trajectory=("elbow_joint", "elbow", "hip_*")),
        "other": JointController(effort=("elbow_joint",)),
    }
    found = {(*map(str, path), message) for path, message in controller_problems(there, controllers)}
    assert any(path == "joint_states" and "already the name of another topic" in said for path, *_, said in found)
    assert ("other", "effort", "joint 'elbow_joint' already obeys the controller 'arm'") in found
    assert any("no moving joint 'elbow'" in said for *_, said in found)
    assert any("no moving joint matches 'hip_*'" in said for *_, said in found)


def test_a_controller_has_one_kind() -> None:
    for keys in ({}, {"position": ("a",), "velocity": ("b",)}):
        with pytest.raises(ValidationError, match="needs exactly one of"):
            JointController.model_validate(keys)
