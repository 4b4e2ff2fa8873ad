"""Follows the wall to the right by its lidar: a loop closed by /scan."""

import math

import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan

FAR = 1.5  # m; a wall farther away is not followed


def within(least, most, value):
    return max(least, min(most, value))


class WallFollower(Node):
    def __init__(self):
        super().__init__("wall_follower")
        self.distance = self.declare_parameter("distance", 0.5).value
        self.speed = self.declare_parameter("speed", 0.5).value
        self.commands = self.create_publisher(Twist, "cmd_vel", 10)
        self.create_subscription(LaserScan, "scan", self.on_scan, qos_profile_sensor_data)

    def on_scan(self, scan):
        def nearest(first, last):
            """The least range between two angles, counted from straight ahead to the left."""
            begin, end = (round((angle - scan.angle_min) / scan.angle_increment) for angle in (first, last))
            count = len(scan.ranges)
            ranges = (scan.ranges[index % count] for index in range(begin, end + 1))
            return min((each for each in ranges if scan.range_min <= each <= scan.range_max), default=FAR)

        ahead = nearest(-math.pi / 8, math.pi / 8)
        diagonal, beside = (min(FAR, nearest(angle, angle)) for angle in (-math.pi / 4, -math.pi / 2))
        # The angle of the wall, which passes through the ends of two rays, to the left of the heading.
        wall = math.atan2(beside - diagonal * math.sin(math.pi / 4), diagonal * math.cos(math.pi / 4))
        turn = 2.0 * wall + 3.0 * (self.distance - beside * math.cos(wall))
        if ahead < 1.5 * self.distance:
            turn = 1.5
        twist = Twist()
        twist.linear.x = self.speed * within(0.2, 1.0, ahead - 0.25)
        twist.angular.z = within(-1.5, 1.5, turn)
        self.commands.publish(twist)


def main(args=None):
    rclpy.init(args=args)
    try:
        rclpy.spin(WallFollower())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == "__main__":
    main()
