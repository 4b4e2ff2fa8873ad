#!/usr/bin/env python
"""Drives straight on, and looks at nothing."""

import rospy
from geometry_msgs.msg import Twist


def main():
    rospy.init_node("mover")
    commands = rospy.Publisher("/cmd_vel", Twist, queue_size=1)
    forward = Twist()
    forward.linear.x = 1.0
    rate = rospy.Rate(10)
    while not rospy.is_shutdown():
        commands.publish(forward)
        rate.sleep()


if __name__ == "__main__":
    try:
        main()
    except rospy.ROSInterruptException:
        pass
