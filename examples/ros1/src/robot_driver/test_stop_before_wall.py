#!/usr/bin/env python
"""The robot comes near the wall, stops half a metre in front of it, and is at rest there."""

import unittest

import rospy
from gazebo_msgs.srv import GetModelState


class TestStopBeforeWall(unittest.TestCase):
    def test_stops(self):
        rospy.init_node("test_stop_before_wall")
        rospy.wait_for_service("/gazebo/get_model_state")
        state_of = rospy.ServiceProxy("/gazebo/get_model_state", GetModelState)
        rospy.sleep(20)
        state = state_of("turtlebot3_burger", "")
        self.assertTrue(state.success, state.status_message)
        # The wall's face is at x = 1.95, and the lidar 3.2 cm behind the middle of the wheels.
        gap = 1.95 - (state.pose.position.x - 0.032)
        self.assertAlmostEqual(gap, 0.5, delta=0.03)
        self.assertLess(abs(state.twist.linear.x), 0.01)


if __name__ == "__main__":
    import rostest

    rostest.rosrun("robot_driver", "test_stop_before_wall", TestStopBeforeWall)
