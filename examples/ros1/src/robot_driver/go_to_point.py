#!/usr/bin/env python
"""Drives to a point of the odometry's frame, and stops there: a closed loop on /odom."""

import math

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry


def clamped(value, most):
    return max(-most, min(most, value))


class Driver:
    def __init__(self):
        self.goal = rospy.get_param("~x", 1.0), rospy.get_param("~y", 0.5)
        self.pose = None
        self.commands = rospy.Publisher("/cmd_vel", Twist, queue_size=1)
        rospy.Subscriber("/odom", Odometry, self.look)

    def look(self, odometry):
        self.pose = odometry.pose.pose

    def command(self):
        """Turns first, then drives, the slower the nearer it is."""
        twist = Twist()
        if self.pose is None:
            return twist
        at, turned = self.pose.position, self.pose.orientation
        yaw = 2 * math.atan2(turned.z, turned.w)
        dx, dy = self.goal[0] - at.x, self.goal[1] - at.y
        way = math.hypot(dx, dy)
        if way > 0.02:
            bearing = math.remainder(math.atan2(dy, dx) - yaw, 2 * math.pi)
            twist.angular.z = clamped(1.5 * bearing, 1.0)
            twist.linear.x = clamped(0.8 * way, 0.22) * max(0.0, math.cos(bearing)) ** 4
        return twist

    def drive(self):
        rate = rospy.Rate(20)
        while not rospy.is_shutdown():
            self.commands.publish(self.command())
            rate.sleep()


if __name__ == "__main__":
    rospy.init_node("go_to_point")
    try:
        Driver().drive()
    except rospy.ROSInterruptException:
        pass
