"""Moves an arm through poses. The next trajectory is sent when /joint_states say that the arm has arrived."""

import rclpy
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

JOINTS = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint"]
POSES = [[0.6, -1.2, 1.4], [-0.4, -1.0, 1.0], [0.0, -1.5, 1.5]]  # rad
TOLERANCE = 0.02  # rad


class Poses(Node):
    def __init__(self):
        super().__init__("poses")
        self.seconds = self.declare_parameter("seconds", 1.0).value
        self.left = list(POSES)
        self.goal = None
        self.trajectories = self.create_publisher(JointTrajectory, "joint_trajectory_controller/joint_trajectory", 1)
        self.create_subscription(JointState, "joint_states", self.on_states, 10)

    def on_states(self, states):
        positions = dict(zip(states.name, states.position))
        if self.goal is None or self.has_arrived(positions):
            self.go_on()

    def has_arrived(self, positions):
        return all(abs(positions[name] - goal) < TOLERANCE for name, goal in zip(JOINTS, self.goal))

    def go_on(self):
        if not self.left:
            return
        self.goal = self.left.pop(0)
        self.get_logger().info(f"moving to {self.goal}")
        rest = [0.0] * len(JOINTS)
        point = JointTrajectoryPoint(positions=self.goal, velocities=rest)
        point.time_from_start = Duration(seconds=self.seconds).to_msg()
        self.trajectories.publish(JointTrajectory(joint_names=JOINTS, points=[point]))


def main(args=None):
    rclpy.init(args=args)
    try:
        rclpy.spin(Poses())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == "__main__":
    main()
