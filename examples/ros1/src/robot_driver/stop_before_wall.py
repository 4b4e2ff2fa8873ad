#!/usr/bin/env python
"""Drives until something is half a metre in front of the lidar: a closed loop on /scan."""

import rospy
from geometry_msgs.msg import Twist
from sensor_msgs.msg import LaserScan

STOP = 0.5


def ahead(scan):
    """The least range within 15 degrees of straight ahead, in m."""
    found = [scan.range_max]
    for index, reading in enumerate(scan.ranges):
        angle = scan.angle_min + index * scan.angle_increment
        is_ahead = min(abs(angle), abs(angle - 6.28319)) < 0.26
        if is_ahead and scan.range_min <= reading <= scan.range_max:
            found.append(reading)
    return min(found)


def main():
    rospy.init_node("stop_before_wall")
    commands = rospy.Publisher("/cmd_vel", Twist, queue_size=1)

    def look(scan):
        twist = Twist()
        twist.linear.x = max(0.0, min(0.22, 0.6 * (ahead(scan) - STOP)))
        commands.publish(twist)

    rospy.Subscriber("/scan", LaserScan, look)
    rospy.spin()


if __name__ == "__main__":
    main()
