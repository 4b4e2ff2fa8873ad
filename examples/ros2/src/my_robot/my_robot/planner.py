"""Plans ten times per second how to get to a goal: publishes the wanted velocity, which may jump."""

import math

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node


class Planner(Node):
    def __init__(self):
        super().__init__("planner")
        self.goal = self.declare_parameter("goal", [1.0, 0.5]).value
        self.speed = self.declare_parameter("speed", 0.5).value
        self.pose = None
        self.plans = self.create_publisher(Twist, "cmd_vel_raw", 10)
        self.create_subscription(Odometry, "odom", self.on_odometry, 10)
        self.create_timer(0.1, self.on_timer)

    def on_odometry(self, odometry):
        self.pose = odometry.pose.pose

    def on_timer(self):
        if self.pose is None:
            return
        position, orientation = self.pose.position, self.pose.orientation
        yaw = 2 * math.atan2(orientation.z, orientation.w)
        dx, dy = self.goal[0] - position.x, self.goal[1] - position.y
        twist = Twist()
        if math.hypot(dx, dy) > 0.03:
            bearing = math.remainder(math.atan2(dy, dx) - yaw, 2 * math.pi)
            twist.linear.x = min(self.speed, 1.2 * math.hypot(dx, dy)) * max(0.0, math.cos(bearing))
            twist.angular.z = max(-1.0, min(1.0, 2.0 * bearing))
        self.plans.publish(twist)


def main(args=None):
    rclpy.init(args=args)
    try:
        rclpy.spin(Planner())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == "__main__":
    main()
