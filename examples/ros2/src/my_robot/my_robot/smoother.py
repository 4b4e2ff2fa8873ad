"""Drives with the velocity that a planner wants, but changes it slowly: 50 times per second."""

import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

PERIOD = 0.02  # s


def toward(target, value, most):
    return value + max(-most, min(most, target - value))


class Smoother(Node):
    def __init__(self):
        super().__init__("smoother")
        self.acceleration = self.declare_parameter("acceleration", 0.5).value
        self.angular_acceleration = self.declare_parameter("angular_acceleration", 4.0).value
        self.wanted, self.now = Twist(), Twist()
        self.commands = self.create_publisher(Twist, "cmd_vel", 10)
        self.create_subscription(Twist, "cmd_vel_raw", self.on_plan, 10)
        self.create_timer(PERIOD, self.on_timer)

    def on_plan(self, twist):
        self.wanted = twist

    def on_timer(self):
        now, wanted = self.now, self.wanted
        now.linear.x = toward(wanted.linear.x, now.linear.x, self.acceleration * PERIOD)
        now.angular.z = toward(wanted.angular.z, now.angular.z, self.angular_acceleration * PERIOD)
        self.commands.publish(now)


def main(args=None):
    rclpy.init(args=args)
    try:
        rclpy.spin(Smoother())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == "__main__":
    main()
