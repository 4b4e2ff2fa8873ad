"""A node of ROS 2: drives one metre ahead, more slowly the nearer it is."""

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node


class DriveOneMetre(Node):
    def __init__(self):
        super().__init__("drive_one_metre")
        self.x = 0.0
        self.publisher = self.create_publisher(Twist, "cmd_vel", 10)
        self.create_subscription(Odometry, "odom", self.on_odometry, 10)
        self.create_timer(0.1, self.on_timer)

    def on_odometry(self, message):
        self.x = message.pose.pose.position.x

    def on_timer(self):
        twist = Twist()
        twist.linear.x = max(0.0, min(0.5, 1.5 * (1.0 - self.x)))
        self.publisher.publish(twist)


if __name__ == "__main__":
    rclpy.init()
    rclpy.spin(DriveOneMetre())
