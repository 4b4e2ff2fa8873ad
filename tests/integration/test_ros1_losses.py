"""Launches that Gazebo would simulate otherwise: what is missing is an error, or a warning if it is allowed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from tests.integration.test_ros1_launches import BURGER, DIES, TEST, WAITS
from tests.ros.ros1.launches import ROOT, needs_ros, package
from tests.ros.ros1.robotis import lay_out

pytestmark = needs_ros

WORLD = """\
<launch>
  <include file="$(find gazebo_ros)/launch/empty_world.launch">
    <arg name="world_name" value="$(find parts)/worlds/{name}.world"/>
  </include>
  <param name="robot_description"
    command="$(find xacro)/xacro $(find turtlebot3_description)/urdf/turtlebot3_burger.urdf.xacro"/>
  <node name="s" pkg="gazebo_ros" type="spawn_model" args="-urdf -model burger -param robot_description"/>
  {test}
</launch>
"""
YARD = """\
<sdf version="1.6"><world name="yard">
  <include><uri>model://ground_plane</uri></include>
  <gui><camera name="c"/></gui><light name="l" type="point"/>
  <actor name="walker"/>
  <model name="rock"><static>1</static><pose>2 0 0 0 0 0</pose><link name="l"><collision name="c">
    <geometry><mesh><uri>model://rock/rock.obj</uri></mesh></geometry></collision></link></model>
  <plugin name="sky" filename="libsky.so"/>
</world></sdf>
"""


def called(folder: Path, program: str, *words: str) -> tuple[int, Outcome, str]:
    """The exit code, the only outcome and the printed text of a call in a workspace with the package `parts`."""
    command = [sys.executable, "-m", "sim_action", program, "--no-report", "parts", *words]
    done = subprocess.run(
        command,
        check=False,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "1000"},
        capture_output=True,
        text=True,
    )
    (outcome,) = Results.model_validate_json((folder / "sim-results/results.json").read_bytes()).outcomes
    return done.returncode, outcome, done.stdout


def test_a_launch_whose_required_node_does_not_exist_is_an_error(tmp_path: Path) -> None:
    launch = f'<launch>\n{BURGER}\n<node pkg="parts" name="driver" type="not_there.py" required="true"/>\n</launch>'
    package(tmp_path, "parts", {"a.launch": launch})

    for words in ((), ("--allow-losses",)):
        code, outcome, printed = called(tmp_path, "roslaunch", "--sim-time-limit", "0.5", *words, "a.launch")

        (failure,) = outcome.failures
        assert (code, outcome.status, failure.title) == (2, "error", "no such node")
        assert str(failure.location) == "src/parts/a.launch:3"
        assert "the package 'parts' has no node 'not_there.py'" in failure.message
        assert "src/parts/a.launch:3" in printed


@pytest.mark.parametrize("program", ["roslaunch", "rostest"])
def test_a_world_file_that_does_not_exist_is_an_error(program: str, tmp_path: Path) -> None:
    test = TEST.format(name="waits", s=0.2) if program == "rostest" else ""
    files = {"a.launch": WORLD.format(name="yrad", test=test), "worlds/yard.world": YARD, "waits.py": WAITS}
    package(tmp_path, "parts", files)

    code, outcome, printed = called(tmp_path, program, "--allow-losses", "a.launch")

    (failure,) = outcome.failures
    assert (code, outcome.status, failure.title) == (2, "error", "no such world")
    assert str(failure.location) == "src/parts/a.launch:3"
    assert failure.message.startswith("the world file 'src/parts/worlds/yrad.world' does not exist; did you mean 'yard")
    assert failure.message in printed


BALL = """\
<robot name="ball"><link name="base">
  <inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><sphere radius="0.1"/></geometry></collision>
  <contact><restitution value="0.9"/></contact>
</link></robot>
"""
THROWN = """\
<launch>
  <include file="$(find gazebo_ros)/launch/empty_world.launch"/>
  <param name="robot_description" textfile="$(find parts)/ball.urdf"/>
  <node name="s" pkg="gazebo_ros" type="spawn_model" args="-urdf -model ball -param robot_description"/>
  <node name="driver" pkg="parts" type="not_there.py"/>
</launch>
"""


def test_a_robot_that_would_bounce_and_a_node_that_is_not_required_and_does_not_exist_are_losses(
    tmp_path: Path,
) -> None:
    package(tmp_path, "parts", {"a.launch": THROWN, "ball.urdf": BALL})
    words = ("--sim-time-limit", "0.5", "a.launch")
    bounces = "<restitution> is 0.9, but nothing bounces in the simulation"
    absent = "the node 'driver' (parts/not_there.py) was not started"

    code, outcome, printed = called(tmp_path, "roslaunch", *words)
    assert (code, outcome.status) == (2, "error")
    of_robot, of_node = sorted(failure.message for failure in outcome.failures)
    assert bounces in of_robot
    assert "the package 'parts' has no node 'not_there.py'" in of_node

    code, outcome, printed = called(tmp_path, "roslaunch", "--allow-losses", *words)
    assert (code, outcome.status) == (0, "passed")
    assert bounces in printed
    assert absent in printed


@pytest.mark.parametrize("program", ["roslaunch", "rostest"])
def test_what_a_world_and_a_robot_lose_is_an_error_unless_it_is_allowed(program: str, tmp_path: Path) -> None:
    test = TEST.format(name="waits", s=0.2) if program == "rostest" else ""
    files = {"a.launch": WORLD.format(name="yard", test=test), "worlds/yard.world": YARD, "waits.py": WAITS}
    package(tmp_path, "parts", files)
    words = ("--sim-time-limit", "2", "a.launch")
    lost = [
        ("src/parts/worlds/yard.world:4", "<actor> is not simulated: nothing can touch or see it"),
        ("src/parts/worlds/yard.world:6", "the mesh 'model://rock/rock.obj' of 'rock' was not found"),
        ("src/parts/worlds/yard.world:7", "the plugin sky of the world is not supported"),
    ]

    code, outcome, printed = called(tmp_path, program, *words)

    assert (code, outcome.status) == (2, "error")
    assert [str(failure.location) for failure in outcome.failures] == [place for place, _ in lost]
    assert all(message in printed for _, message in lost)

    code, outcome, printed = called(tmp_path, program, "--allow-losses", *words)

    assert (code, outcome.status) == (0, "passed")
    assert [str(warning.location) for warning in outcome.warnings] == [place for place, _ in lost]
    assert all(message in printed for _, message in lost)
    assert "--allow-losses" in outcome.call


RATES = """\
#!/usr/bin/env python
import unittest, rospy, rostest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
class Rates(unittest.TestCase):
    def test_rates(self):
        rospy.init_node("rates")
        odometry, joints = [], []
        rospy.Subscriber("/odom", Odometry, odometry.append, queue_size=100)
        rospy.Subscriber("/joint_states", JointState, joints.append, queue_size=100)
        rospy.sleep(0.5)
        start = rospy.get_time()
        rospy.sleep(3.0)
        stamps = [message.header.stamp.to_sec() for message in odometry]
        self.assertEqual(len([stamp for stamp in stamps if start < stamp <= start + 3.0]), 90)
        self.assertEqual(joints[0].name, ["wheel_left_joint", "wheel_right_joint"])
        self.assertEqual(len(joints[0].position), 2)
        diagonal = odometry[0].pose.covariance[::7]
        self.assertEqual([round(value, 6) for value in diagonal], [1e-5, 1e-5, 1e12, 1e12, 1e12, 1e-3])
rostest.rosrun("parts", "rates", Rates)
"""


def test_the_plugins_of_robotis_have_their_rates_wheel_positions_and_covariances(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TURTLEBOT3_MODEL", "burger")
    lay_out(tmp_path)
    test = '<test test-name="rates" pkg="parts" type="rates.py" time-limit="60"/>'
    package(tmp_path, "parts", {"a.test": f"<launch>{BURGER}{test}</launch>", "rates.py": RATES})

    code, outcome, printed = called(tmp_path, "rostest", "a.test")

    assert (code, outcome.status, outcome.warnings) == (0, "passed", ()), printed


def test_a_test_that_runs_no_method_or_skips_all_does_not_pass(tmp_path: Path) -> None:
    nothing = WAITS.replace("def test_", "def check_")
    skipped = WAITS.replace("class Waits", "@unittest.skip('no battery')\nclass Waits")
    for text, status, message in ((nothing, "error", "ran no method"), (skipped, "not_exercised", "no battery")):
        launch = f"<launch>{BURGER}{TEST.format(name='waits', s=0.2)}</launch>"
        package(tmp_path, "parts", {"a.test": launch, "waits.py": text})

        code, outcome, _ = called(tmp_path, "rostest", "a.test")

        assert (code, outcome.status) == (1, status)
        told = [failure.message for failure in outcome.failures]
        assert message in " ".join([*told, *(expected.verdict.message for expected in outcome.expectations)])


def test_a_node_that_dies_right_before_a_short_limit_fails_the_launch(tmp_path: Path) -> None:
    # The process needs longer to end than the rest of the simulation; rospy leaves the graph of nodes before that.
    slow = DIES.replace("import rospy", "import atexit, time\natexit.register(time.sleep, 1.5)\nimport rospy")
    launch = f'<launch>{BURGER}<node pkg="parts" name="it" type="dies.py"/></launch>'
    package(tmp_path, "parts", {"a.launch": launch, "dies.py": slow})

    code, outcome, _ = called(tmp_path, "roslaunch", "--sim-time-limit", "0.4", "a.launch")

    assert (code, outcome.status) == (1, "failed")
    assert outcome.expectations[0].verdict.message.startswith("the node 'it' ended with exit code 1")
