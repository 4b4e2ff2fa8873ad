#!/usr/bin/env python
"""The robot comes to the point within 15 s of sim time, and stays there."""

import math
import unittest

import rospy
from nav_msgs.msg import Odometry


class TestGoToPoint(unittest.TestCase):
    def setUp(self):
        rospy.init_node("test_go_to_point")
        self.way, self.speed = math.inf, math.inf
        rospy.Subscriber("/odom", Odometry, self.look)

    def look(self, odometry):
        at, twist = odometry.pose.pose.position, odometry.twist.twist
        self.way = math.hypot(at.x - 1.0, at.y - 0.5)
        self.speed = math.hypot(twist.linear.x, twist.linear.y)

    def test_1_comes_to_the_point(self):
        while self.way > 0.03 and rospy.get_time() < 15 and not rospy.is_shutdown():
            rospy.sleep(0.1)
        self.assertLess(self.way, 0.03)

    def test_2_stays_there(self):
        rospy.sleep(2)
        self.assertLess(self.way, 0.03)
        self.assertLess(self.speed, 0.01)


if __name__ == "__main__":
    import rostest

    rostest.rosrun("robot_driver", "test_go_to_point", TestGoToPoint)
