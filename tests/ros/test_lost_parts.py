"""The parts of launch files of either ROS that a scenario does not replace."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

from sim_action.ros.lost_parts import LeftOutProgram, lost_parts
from sim_action.ros.ros1.command_source.launched_nodes import REPLACED_CONTROLLERS
from sim_action.ros.ros1.command_source.launched_nodes import lost_controller as lost_in_ros1
from sim_action.ros.ros2.launch.launched_nodes import lost_controller as lost_in_ros2

CREATE = "ros_gz_sim/create"
SPAWN = "gazebo_ros/spawn_model"
SPAWNER = "controller_manager/spawner"
MANAGER = "controller_manager/controller_manager"


def left_out(program: str, *args: str) -> LeftOutProgram:
    return LeftOutProgram(program, args)


def lost(*programs: LeftOutProgram, world: str = "", **types: str) -> list[str]:
    return list(lost_parts(programs, partial(lost_in_ros1, types=types), [world]))


@pytest.mark.parametrize(
    "programs",
    [
        [left_out("gz", "sim", "-r -s -v4 empty.sdf")],
        [left_out("gz", "sim", "-g -v2 ")],
        [left_out("/usr/bin/gzserver", "/opt/worlds/empty_world.world")],
        [left_out("gazebo_ros/gzserver"), left_out("gazebo_ros/gzclient"), left_out(SPAWN, "-urdf", "-model", "r")],
        [left_out(SPAWN, "-sdf", "-model", "rover", "-database", "rover")],
        [left_out(CREATE, "-topic", "robot_description", "-name", "bot")],
        [left_out(CREATE, "-file", "/models/burger/model.sdf", "-name", "burger")],
        [left_out("ros_gz_bridge/parameter_bridge", "/clock@rosgraph_msgs/msg/Clock[gz.msgs.Clock")],
        [left_out(SPAWNER, "joint_state_broadcaster", "--controller-manager", "/controller_manager")],
        [left_out(SPAWNER, "-c", "/controller_manager", "diff_cont", "--ros-args", "-r", "a:=b")],
        [left_out(MANAGER, "list")],
    ],
)
def test_what_the_scenario_replaces(programs: list[LeftOutProgram]) -> None:
    assert list(lost_parts(programs, partial(lost_in_ros2, command_topics={"/diff_cont/cmd_vel"}))) == []
    assert lost(world="worlds/empty.world") == []


@pytest.mark.parametrize(
    ("world", "server"),
    [("/a/yard.world", ""), ("", "-e ode /a/yard.world"), ("/a/yard.world", "/a/yard.world"), ("", "-r /a/yard.sdf")],
)
def test_another_world_is_lost_once_for_each_name(world: str, server: str) -> None:
    # With `debug:=true`, empty_world.launch starts the server by another program.
    programs = ("gazebo_ros/gzserver", "gazebo_ros/debug")
    (message,) = {said for program in programs for said in lost(left_out(program, server), world=world)}
    assert message.startswith("the world 'yard.")
    assert message.endswith("of the launch file is not simulated: add its objects to 'world'")


ROBOT = left_out(CREATE, "-topic", "robot_description", "-name", "bot")


@pytest.mark.parametrize(
    ("programs", "name"),
    [
        ([ROBOT, left_out(CREATE, "-file", "/models/crate.sdf", "-name", "crate")], "crate"),
        ([left_out(SPAWN, "-sdf", "-model", "crate", "-file", "/crate.sdf"), ROBOT], "crate"),
        ([ROBOT, left_out("gazebo_ros/spawn_entity.py", "-entity", "second", "-topic", "x")], "second"),
        ([ROBOT, left_out(CREATE, "-topic", "x")], "without a name"),
    ],
)
def test_further_models_are_lost(programs: list[LeftOutProgram], name: str) -> None:
    (message,) = lost(*programs)
    assert message == f"the model '{name}' is not spawned: the scenario has one robot, and its objects are in 'world'"


def test_controllers_of_ros_1_other_than_those_of_the_base_are_lost() -> None:
    arm = "position_controllers/JointTrajectoryController"
    spawner = left_out(SPAWNER, "--namespace", "/r", "arm", "joints", "--shutdown-timeout=3")
    (message,) = lost(spawner, arm=arm, joints="joint_state_controller/JointStateController")
    assert message.startswith(f"the controller 'arm' ({arm}) does not run")
    assert [text.split("'")[1] for text in lost(spawner)] == ["arm", "joints"]
    assert [text.split("'")[1] for text in lost(left_out(MANAGER, "spawn", "arm"))] == ["arm"]
    assert all(REPLACED_CONTROLLERS.values())


def test_controllers_of_ros_2_without_a_topic_of_the_robot_are_lost(tmp_path: Path) -> None:
    file = tmp_path / "controllers.yaml"
    file.write_text(
        "controller_manager:\n  ros__parameters:\n"
        "    arm: {type: joint_trajectory_controller/JointTrajectoryController}\n"
        "    states: {type: joint_state_broadcaster/JointStateBroadcaster}\n"
    )
    spawners = (("arm", "states", "--param-file", str(file)), ("-p", "missing", "grip"))
    programs = [left_out(SPAWNER, *words) for words in spawners]
    arm = "'arm' (joint_trajectory_controller/JointTrajectoryController)"
    why = "does not run, and the robot takes no commands on"
    assert list(lost_parts(programs, partial(lost_in_ros2, command_topics={"/cmd_vel", "/armed/cmd_vel"}))) == [
        f"the controller {arm} {why} /arm/...: name its topic in 'topics'",
        f"the controller 'grip' {why} /grip/...: name its topic in 'topics'",
    ]
