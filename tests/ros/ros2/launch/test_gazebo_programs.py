"""What a scenario replaces of a launch file with Gazebo, and what is lost."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.ros.ros2.installation import packages_of_prefix
from sim_action.ros.ros2.launch.gazebo_programs import LeftOutProgram, lost_parts, unheard_bridges, write_prefix

CREATE = "ros_gz_sim/create"
SPAWNER = "controller_manager/spawner"


def left_out(program: str, *args: str) -> LeftOutProgram:
    return LeftOutProgram(program, args)


@pytest.mark.parametrize(
    "programs",
    [
        [left_out("gz", "sim", "-r -s -v4 empty.sdf")],
        [left_out("gz", "sim", "-g -v2 ")],
        [left_out("/usr/bin/gzserver", "/opt/worlds/empty_world.world")],
        [left_out(CREATE, "-topic", "robot_description", "-name", "bot")],
        [left_out(CREATE, "-file", "/models/burger/model.sdf", "-name", "burger")],
        [left_out("ros_gz_bridge/parameter_bridge", "/clock@rosgraph_msgs/msg/Clock[gz.msgs.Clock")],
        [left_out(SPAWNER, "joint_state_broadcaster", "--controller-manager", "/controller_manager")],
        [left_out(SPAWNER, "-c", "/controller_manager", "diff_cont", "--ros-args", "-r", "a:=b")],
    ],
)
def test_what_the_scenario_replaces(programs: list[LeftOutProgram]) -> None:
    assert list(lost_parts(programs, {"/diff_cont/cmd_vel"})) == []


def test_worlds_and_further_models_are_lost() -> None:
    programs = [
        left_out("gz", "sim", "-r /worlds/house.sdf"),
        left_out(CREATE, "-file", "/models/crate.sdf", "-name", "crate"),
        left_out(CREATE, "-topic", "robot_description", "-name", "bot"),
        left_out("gazebo_ros/spawn_entity.py", "-entity", "second", "-topic", "robot_description"),
    ]
    assert list(lost_parts(programs, ())) == [
        "the world 'house.sdf' of the launch file is not simulated: add its objects to 'world'",
        "the model 'crate' is not spawned: the scenario has one robot, and its objects are in 'world'",
        "the model 'second' is not spawned: the scenario has one robot, and its objects are in 'world'",
    ]


def test_controllers_without_a_topic_of_the_robot_are_lost(tmp_path: Path) -> None:
    file = tmp_path / "controllers.yaml"
    file.write_text(
        "controller_manager:\n  ros__parameters:\n"
        "    arm: {type: joint_trajectory_controller/JointTrajectoryController}\n"
        "    states: {type: joint_state_broadcaster/JointStateBroadcaster}\n"
    )
    programs = [
        left_out(SPAWNER, "arm", "states", "--param-file", str(file)),
        left_out(SPAWNER, "-p", "missing", "grip"),
    ]
    arm = "'arm' (joint_trajectory_controller/JointTrajectoryController)"
    why = "does not run, and the robot takes no commands on"
    assert list(lost_parts(programs, {"/cmd_vel", "/armed/cmd_vel"})) == [
        f"the controller {arm} {why} /arm/...: name its topic in 'topics'",
        f"the controller 'grip' {why} /grip/...: name its topic in 'topics'",
    ]


def test_bridged_topics_that_the_robot_does_not_publish() -> None:
    program = left_out(
        "ros_gz_bridge/parameter_bridge",
        "/scan@sensor_msgs/msg/LaserScan[gz.msgs.LaserScan",
        "/depth@sensor_msgs/msg/Image[gz.msgs.Image",
        "/lidar@sensor_msgs/msg/LaserScan[gz.msgs.LaserScan",
        "/cmd_vel@geometry_msgs/msg/Twist]gz.msgs.Twist",
        *("--ros-args", "-r", "/lidar:=scan"),
    )
    assert list(unheard_bridges([program], {"/scan"})) == [
        "the launch file bridges /depth to ROS 2, and the robot does not publish it"
    ]


def test_packages_are_indexed_and_their_launch_files_compile(tmp_path: Path) -> None:
    prefix = write_prefix(tmp_path / "gazebo")
    assert {"ros_gz_sim", "ros_gz_bridge", "gazebo_ros"} <= set(packages_of_prefix(prefix))
    files = {path.name: path.read_text() for path in prefix.rglob("*.launch.py")}
    assert {"gz_sim.launch.py", "gz_spawn_model.launch.py", "gzserver.launch.py"} <= set(files)
    for name, text in files.items():
        compile(text, name, "exec")
    assert "('gz', 'sim', '{gz_args}', '{ign_args}')" in files["gz_sim.launch.py"]
    assert 'startswith("{")' in files["gz_sim.launch.py"]
