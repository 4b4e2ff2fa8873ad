"""Drives straight ahead until odometry says that the robot has come far enough, and stops."""

import math

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node


class Mover(Node):
    def __init__(self):
        super().__init__("mover")
        self.distance = self.declare_parameter("distance", 1.5).value
        self.speed = self.declare_parameter("speed", 0.5).value
        self.start = None
        self.travelled = 0.0
        self.commands = self.create_publisher(Twist, "cmd_vel", 10)
        self.create_subscription(Odometry, "odom", self.on_odometry, 10)
        self.create_timer(0.05, self.on_timer)

    def on_odometry(self, odometry):
        position = odometry.pose.pose.position
        if self.start is None:
            self.start = position
        self.travelled = math.hypot(position.x - self.start.x, position.y - self.start.y)

    def on_timer(self):
        twist = Twist()
        if self.travelled < self.distance:
            twist.linear.x = self.speed
        self.commands.publish(twist)


def main(args=None):
    rclpy.init(args=args)
    try:
        rclpy.spin(Mover())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == "__main__":
    main()
