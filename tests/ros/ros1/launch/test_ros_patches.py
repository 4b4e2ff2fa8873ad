"""The patches of ROS: every Python of a launch reads them, and they hide no other sitecustomize."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from sim_action.ros import node_start
from sim_action.ros.launches import LaunchRequest
from sim_action.ros.ros1.launch import ros_patches
from tests.ros.ros1.launches import launched, needs_ros, package

pytestmark = pytest.mark.process


def test_a_sitecustomize_that_was_there_is_read_after_ours(tmp_path: Path) -> None:
    ours, theirs = tmp_path / "ours", tmp_path / "theirs"
    ours.mkdir()
    theirs.mkdir()
    (ours / "sitecustomize.py").symlink_to(node_start.__file__)
    (ours / f"{node_start.PATCHES}.py").symlink_to(ros_patches.__file__)
    (theirs / "sitecustomize.py").write_text("import sys\nsys.hooked = True\n")
    rospy = theirs / "rospy"
    rospy.mkdir()
    (rospy / "__init__.py").write_text("from rospy.client import wait_for_message\n")
    (rospy / "client.py").write_text("def wait_for_message(): ...\ndef get_param(): ...\n")
    modules = "rospy.wait_for_message.__module__, rospy.client.get_param.__module__"
    code = f"import rospy, rospy.client, sys; print(sys.hooked, {modules})"
    variables = {**os.environ, "PYTHONPATH": f"{ours}{os.pathsep}{theirs}"}
    said = subprocess.run([sys.executable, "-c", code], env=variables, capture_output=True, text=True, check=True)
    assert said.stdout.split() == ["True", node_start.PATCHES, "rospy.client"]


# Begins to drive, and to listen, amid the run and again and again: when it is heard, and hears, must be the same.
LATE = r"""#!/usr/bin/env python
import socket
import unittest

import rospy
from gazebo_msgs.msg import ModelState
from gazebo_msgs.srv import GetModelState, SetModelState
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry

ROBOT = "turtlebot3_burger"


def driven():
    publisher = rospy.Publisher("/cmd_vel", Twist, queue_size=1, latch=True)
    publisher.publish(linear=Vector3(0.2, 0, 0))
    rospy.sleep(0.5)
    came = rospy.ServiceProxy("/gazebo/get_model_state", GetModelState)(ROBOT, "").pose.position.x
    publisher.publish(Twist())
    rospy.sleep(0.2)
    publisher.unregister()
    rospy.ServiceProxy("/gazebo/set_model_state", SetModelState)(ModelState(model_name=ROBOT))
    rospy.sleep(0.3)
    return came


def heard():
    stamps = []
    subscriber = rospy.Subscriber("/odom", Odometry, lambda message: stamps.append(message.header.stamp))
    began = rospy.Time.now()
    rospy.sleep(0.45)
    subscriber.unregister()
    rospy.sleep(0.45)
    return [(stamp - began).to_nsec() for stamp in stamps]


class Late(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("late")
        rospy.sleep(0.5)

    def test_who_publishes_is_heard_as_soon(self):
        driven()
        came = [driven() for _ in range(2)]
        self.assertGreater(min(came), 0.07)
        self.assertLess(max(came) - min(came), 0.0005)

    def test_who_listens_hears_as_much(self):
        # 0.9 s are a multiple of what is between two messages.
        first, *others = [heard() for _ in range(3)]
        self.assertEqual(others, [first] * 2)

    def test_small_messages_are_not_held_back(self):
        publisher = rospy.Publisher("/late", Twist, queue_size=1)
        rospy.Subscriber("/late", Twist, lambda message: None)
        rospy.sleep(0.1)
        (connection,) = publisher.impl.connections
        self.assertTrue(connection.socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))
        listening = rospy.impl.tcpros_pubsub.TCPROSSub("/late", Twist)
        self.assertEqual(listening.get_header_fields()["tcp_nodelay"], "1")


if __name__ == "__main__":
    import rostest

    rostest.rosrun("late", "late", Late)
"""
LATE_TEST = """<launch>
  <include file="$(find turtlebot3_gazebo)/launch/turtlebot3_empty_world.launch"/>
  <test test-name="late" pkg="late" type="late.py"/>
</launch>
"""


@needs_ros
def test_who_comes_late_is_heard_and_hears_at_once(tmp_path: Path) -> None:
    package(tmp_path / "ws", "late", {"late.py": LATE, "late.test": LATE_TEST})
    found = launched(tmp_path / "run", LaunchRequest("rostest", "late", "late.test", workspace=tmp_path / "ws"))
    (test,) = found.tests
    assert test.methods is not None, found.text
    assert [case.text for case in test.methods.cases] == ["", "", ""], found.text
