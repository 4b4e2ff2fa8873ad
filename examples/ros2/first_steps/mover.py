import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

DISTANCE = 1.5  # m


class Mover(Node):
    def __init__(self):
        super().__init__("mover")
        self.x = 0.0
        self.publisher = self.create_publisher(Twist, "cmd_vel", 10)
        self.create_subscription(Odometry, "odom", self.on_odometry, 10)
        self.create_timer(0.05, self.on_timer)

    def on_odometry(self, message):
        self.x = message.pose.pose.position.x

    def on_timer(self):
        twist = Twist()
        twist.linear.x = max(0.0, min(0.5, 1.5 * (DISTANCE - self.x)))
        self.publisher.publish(twist)


def main():
    rclpy.init()
    try:
        rclpy.spin(Mover())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == "__main__":
    main()
