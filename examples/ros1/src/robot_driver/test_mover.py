#!/usr/bin/env python
"""The robot comes 1.5 m far; how long that may take is said in the .test file."""

import math
import unittest

import rospy
from gazebo_msgs.msg import ModelStates


class TestMover(unittest.TestCase):
    def setUp(self):
        rospy.init_node("test_mover")
        self.way = 0.0
        rospy.Subscriber("/gazebo/model_states", ModelStates, self.look)

    def look(self, states):
        at = states.pose[states.name.index("turtlebot3_burger")].position
        self.way = math.hypot(at.x, at.y)

    def test_comes_far(self):
        while self.way < 1.5 and not rospy.is_shutdown():
            rospy.loginfo("%.2f m", self.way)
            rospy.sleep(0.5)
        self.assertGreaterEqual(self.way, 1.5)


if __name__ == "__main__":
    import rostest

    rostest.rosrun("robot_driver", "test_mover", TestMover)
