"""Scenarios whose nodes are started by real launch files of ROS 2, in lock-step."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import pytest

from tests.integration.conftest import outcomes as stored_outcomes
from tests.ros.ros2.nodes import MOVER, SMOOTHER, command, missing_launch, needs_launch, needs_ros2, outcomes, scenario
from tests.ros.ros2.prefixes import source

BUILT_IN: Final = Path(__file__).parents[2] / "sim_action/robot/built_in"

START = """\
import os

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import *
from launch.event_handlers import OnProcessExit
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description():
"""

DIES = "raise ValueError('no plan')\n"

# A planner after 0.5 s of sim time, and a smoother as soon as the robot is spawned.
CHAIN = """\
    gazebo = os.path.join(get_package_share_directory("ros_gz_sim"), "launch", "gz_sim.launch.py")
    create = Node(package="ros_gz_sim", executable="create", arguments=["-topic", "robot_description"])
    topics = ["/clock@rosgraph_msgs/msg/Clock[gz.msgs.Clock", "/depth@sensor_msgs/msg/Image[gz.msgs.Image"]
    planner = Node(package="robot", executable="mover", remappings=[("cmd_vel", "cmd_vel_raw")])
    smoother = Node(package="robot", executable="smoother", parameters=[{"use_sim_time": False}])
    return LaunchDescription([
        IncludeLaunchDescription(PythonLaunchDescriptionSource(gazebo), launch_arguments=[("gz_args", "-r empty.sdf")]),
        Node(package="ros_gz_bridge", executable="parameter_bridge", arguments=topics),
        create,
        RegisterEventHandler(OnProcessExit(target_action=create, on_exit=[smoother])),
        TimerAction(period=0.5, actions=[planner]),
    ])
"""

INCLUDED = """\
launch:
- arg: {name: topic, default: none}
- group:
  - push-ros-namespace: {namespace: a}
  - node:
      pkg: robot
      exec: mover
      param: [{name: use_sim_time, value: false}]
      remap: [{from: cmd_vel, to: $(var topic)}, {from: odom, to: /odom}]
"""

INCLUDING = """\
<launch>
  <arg name="topic" default="none"/>
  <include file="$(find-pkg-share robot)/launch/included.launch.yaml"><arg name="topic" value="$(var topic)"/></include>
</launch>
"""


def workspace(folder: Path, **launches: str) -> None:
    """Write a package `robot` with nodes and launch files; those in Python by their bodies."""
    programs = {"mover": MOVER, "smoother": SMOOTHER, "dies": DIES}
    entries = [f"{name} = robot.{name}:main" for name in programs]
    files = {f"robot/{name}.py": text for name, text in programs.items()}
    files |= {"setup.py": f"from setuptools import setup\n\nsetup(entry_points={{'console_scripts': {entries}}})\n"}
    files |= {f"launch/{name}.launch.py": START + text for name, text in launches.items()}
    files |= {"launch/included.launch.yaml": INCLUDED, "launch/including.launch.xml": INCLUDING}
    source(folder, "robot", files)
    (folder / ".git").mkdir()


@needs_ros2
def test_launched_nodes_have_the_same_result_every_time(tmp_path: Path) -> None:
    workspace(tmp_path, chain=CHAIN)
    for name in ("chain1", "chain2"):
        scenario(tmp_path, name, "{launch: [robot, chain.launch.py]}", PATIENT)
    scenario(tmp_path, "xml", "{launch: [robot, including.launch.xml, 'topic:=/cmd_vel']}", PATIENT)
    digests = dict[str, str]()
    for name, outcome in outcomes(tmp_path, ".", "--jobs", "2").items():
        assert (outcome["status"], outcome["warnings"]) == ("passed", []), outcome
        assert outcome["travelled"] > 0.3
        digests[name] = outcome["digest"]
        if name == "chain1":
            programs = "gz, ros_gz_bridge/parameter_bridge, ros_gz_sim/create"
            assert outcome["notes"][-2:] == [
                f"not started, because sim-action is the simulator: {programs}",
                "the launch file bridges /depth to ROS 2, and the robot does not publish it",
            ]
    assert digests["chain1"] == digests["chain2"] != digests["xml"]


# Sim time begins when all nodes are up, which may take long on a busy machine.
PATIENT = "wall_limit: 600 s\nexpect:\n  - path_length: {at_most: 8 m}\n"

LIST = "    return LaunchDescription([{}])\n"


def starting(action: str) -> str:
    return f"    return LaunchDescription([{action}])\n"


def node(package: str, program: str) -> str:
    return starting(f'Node(package="{package}", executable="{program}")')


def process(*words: str, more: str = "") -> str:
    return starting(f"ExecuteProcess(cmd={list(words)}{more})")


# Name -> body of the launch file, a part of the message, and the line that it names.
FAILING = {
    "dies": (node("robot", "dies"), "ended with exit code 1: ValueError: no plan", 1),
    "ends": (
        process("sh", "-c", "exit 0", more=', on_exit=Shutdown(reason="sh is required")'),
        "the launch file ended the launch during the run: sh is required",
        4,
    ),
    "raises": (
        "    import xacro\n    return 1 / xacro.__name__.index('x')\n",
        "ZeroDivisionError: division by zero",
        14,
    ),
    "package": (
        node("robto", "mover"),
        "there is no package 'robto' in the workspace or ROS 2; did you mean 'robot'?",
        4,
    ),
    "program": (node("robot", "moover"), "the package 'robot' has no executable 'moover'; did you mean 'mover'?", 4),
    "start": (process("/no/such/program"), "'/no/such/program' cannot be started: No such file or directory", 4),
    "lost": (
        process("gz", "sim", "house.sdf"),
        "is not simulated: add its objects to 'world'; to run without it, set allow_losses: true",
        4,
    ),
}


@needs_ros2
def test_one_message_says_why_a_launch_failed(tmp_path: Path) -> None:
    workspace(tmp_path, **{name: body for name, (body, _, _) in FAILING.items()})
    for name in FAILING:
        scenario(tmp_path, name, f"{{launch: [robot, {name}.launch.py]}}", PATIENT)
    scenario(tmp_path, "argument", "{launch: [robot, including.launch.xml, 'topci:=/cmd_vel']}", PATIENT)
    found = outcomes(tmp_path, ".", "--jobs", "2")
    messages = {"argument": "it has no argument 'topci'; did you mean 'topic'?"}
    messages |= {name: message for name, (_, message, _) in FAILING.items()}
    assert {
        name: messages[name] in outcome["failures"][0]["message"] for name, outcome in found.items()
    } == dict.fromkeys(messages, True), {name: outcome["failures"] for name, outcome in found.items()}
    lines = {name: (outcome["failures"][0]["location"] or {}).get("line") for name, outcome in found.items()}
    # launch does not know where an action stands; the reader without it does.
    named = {"package": 13, "program": 13, "start": 13} if missing_launch() else {}
    assert lines == {"argument": 4, **{name: line for name, (_, _, line) in FAILING.items()}, **named}


DESCRIBES = """\
import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

rclpy.init()
node = Node("describes")
latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
text = node.declare_parameter("robot_description", "").value
node.create_publisher(String, "robot_description", latched).publish(String(data=text))
rclpy.spin(node)
"""

LAUNCH_TEST = """\
import os
import time
import unittest

import launch_testing.actions
import rclpy
from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription, TimerAction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch_ros.actions import Node
from nav_msgs.msg import Odometry
from rclpy.parameter import Parameter


def generate_test_description():
    gazebo = os.path.join(get_package_share_directory("ros_gz_sim"), "launch", "gz_sim.launch.py")
    urdf = open(os.path.join(get_package_share_directory("robot"), "robot.urdf")).read()
    topics = ["/cmd_vel@geometry_msgs/msg/Twist]gz.msgs.Twist", "/odom@nav_msgs/msg/Odometry[gz.msgs.Odometry"]
    return LaunchDescription([
        IncludeLaunchDescription(PythonLaunchDescriptionSource(gazebo), launch_arguments=[("gz_args", "-r empty.sdf")]),
        Node(package="robot", executable="describes", parameters=[{"robot_description": urdf}]),
        Node(package="ros_gz_sim", executable="create", arguments=["-topic", "robot_description", "-x", "-1.0"]),
        Node(package="ros_gz_bridge", executable="parameter_bridge", arguments=topics),
        Node(package="robot", executable="mover"),
        TimerAction(period=0.2, actions=[launch_testing.actions.ReadyToTest()]),
    ])


class TestDrive(unittest.TestCase):
    def test_drives(self):
        rclpy.init()
        node = rclpy.create_node("tester", parameter_overrides=[Parameter("use_sim_time", value=True)])
        seen = []
        node.create_subscription(Odometry, "odom", seen.append, 10)
        while not seen or seen[-1].pose.pose.position.x < 0.5:
            rclpy.spin_once(node, timeout_sec=0.1)
        assert node.get_clock().now().nanoseconds > 0

    def test_flies(self):
        self.fail("it does not fly")

    @unittest.skip("no water")
    def test_swims(self):
        pass
"""


@needs_launch
def test_a_launch_test_gets_the_robot_that_it_spawns(tmp_path: Path) -> None:
    workspace(tmp_path)
    package = tmp_path / "src/robot"
    (package / "robot/describes.py").write_text(DESCRIBES)
    (package / "setup.py").write_text(
        "from setuptools import setup\n\n"
        "setup(entry_points={'console_scripts': ['mover = robot.mover:main', 'describes = robot.describes']})\n"
    )
    (package / "robot.urdf").write_text((BUILT_IN / "turtlebot3_burger.urdf").read_text())
    (package / "test").mkdir()
    (package / "test/drive_test.py").write_text(LAUNCH_TEST)
    done = command(tmp_path, "launchtest", "robot", "drive_test.py", "--sim-time-limit", "600")
    assert (tmp_path / "sim-results/results.json").exists(), done.stdout + done.stderr
    (outcome,) = stored_outcomes(tmp_path)
    verdicts = {each["name"]: each["verdict"] for each in outcome["expectations"]}
    assert {name: verdict["passed"] for name, verdict in verdicts.items()} == {
        "test_drives": True,
        "test_flies": False,
        "test_swims": False,
    }, outcome
    assert verdicts["test_flies"]["message"] == "AssertionError: it does not fly"
    assert (
        verdicts["test_swims"]["message"]
        == "never checked: the test skipped this case (no water); let it run, or remove it"
    )
    assert (outcome["status"], done.returncode) == ("failed", 1)
    missing = command(tmp_path, "launchtest", "robot", "drive_tset.py")
    assert "did you mean 'drive_test.py'?" in missing.stdout
    assert missing.returncode == 2


@needs_ros2
@pytest.mark.skipif(not missing_launch(), reason="launch is installed")
def test_a_part_that_only_launch_has_is_named(tmp_path: Path) -> None:
    workspace(tmp_path, container=starting("EmitEvent(event=LogInfo(msg=''))"))
    scenario(tmp_path, "container", "{launch: [robot, container.launch.py]}", PATIENT)
    (failure,) = outcomes(tmp_path, ".")["container"]["failures"]
    assert "the event 'launch.actions.LogInfo' of EmitEvent needs the Python package 'launch'" in failure["message"]
