"""Topics of a robot, and commands of its base and its joints, with real nodes and message classes of ROS 2."""

from __future__ import annotations

import json
from pathlib import Path

from tests.ros.ros2.nodes import needs_ros2, outcomes

pytestmark = needs_ros2

LISTENER = """\
import json
import os

import rclpy
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, Image, Imu, JointState, LaserScan
from std_msgs.msg import Bool, String

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TOPICS = {
    "/odom": (Odometry, 10),
    "/joint_states": (JointState, qos_profile_sensor_data),
    "/scan": (LaserScan, qos_profile_sensor_data),
    "/imu": (Imu, 10),
    "/contact": (Bool, 10),
    "/eye/image_raw": (Image, qos_profile_sensor_data),
    "/eye/depth/image_raw": (Image, qos_profile_sensor_data),
    "/eye/camera_info": (CameraInfo, 10),
    "/robot_description": (String, LATCHED),
}
SHOWN = {
    "/odom": lambda message: [message.header.frame_id, message.child_frame_id, round(message.pose.pose.position.z, 2)],
    "/joint_states": lambda message: message.name,
    "/scan": lambda message: [len(message.ranges), round(message.range_max, 3), message.header.frame_id],
    "/imu": lambda message: [message.angular_velocity_covariance[0], round(message.linear_acceleration.z, 2)],
    "/contact": lambda message: message.data,
    "/eye/image_raw": lambda message: [message.encoding, message.step, len(message.data), message.header.frame_id],
    "/eye/depth/image_raw": lambda message: [message.encoding, message.step, len(message.data)],
    "/eye/camera_info": lambda message: [message.distortion_model, len(message.d), message.k[2], message.p[6]],
    "/robot_description": lambda message: message.data[:6],
}


class Listener(Node):
    def __init__(self):
        super().__init__("listener")
        self.stamps = {topic: [] for topic in TOPICS}
        self.first = {}
        for topic, (kind, qos) in TOPICS.items():
            self.create_subscription(kind, topic, lambda message, topic=topic: self.hear(topic, message), qos)
        self.create_timer(0.9, self.write)
        self.commands = self.create_publisher(TwistStamped, "cmd_vel", qos_profile_sensor_data)
        self.create_timer(0.2, self.drive)

    def drive(self):
        message = TwistStamped()
        message.twist.linear.x = 0.2
        self.commands.publish(message)

    def hear(self, topic, message):
        self.first.setdefault(topic, SHOWN[topic](message))
        head = getattr(message, "header", None)
        self.stamps[topic].append(head and head.stamp.sec * 10**9 + head.stamp.nanosec)

    def write(self):
        with open(os.path.join(os.path.dirname(__file__), "heard.json"), "w") as file:
            json.dump({"first": self.first, "stamps": self.stamps}, file)


rclpy.init()
rclpy.spin(Listener())
"""

BURGER = """\
name: burger
robot: {model: turtlebot3_burger}
commands:
  ros2: {nodes: [./listener.py]}
sensors:
  - {lidar: {rays: 90, range: 3.5 m}, link: base_scan, rate: 5 Hz}
  - {imu: {gyro_noise: 0.5 rad/s}, rate: 60 Hz}
  - {camera: {width: 8, height: 6}, name: eye, rate: 10 Hz}
  - {contact, link: wheel_left_link}
expect: [{travel: {at_least: 0.1 m}}]
time_limit: 1 s
"""

FIRST = {
    "/odom": ["odom", "base_footprint", 0.0],
    "/joint_states": ["wheel_left_joint", "wheel_right_joint"],
    "/scan": [90, 3.5, "base_scan"],
    "/imu": [0.25, 9.81],
    "/contact": True,
    "/eye/image_raw": ["rgb8", 24, 144, "eye_optical_frame"],
    "/eye/depth/image_raw": ["32FC1", 32, 192],
    "/eye/camera_info": ["plumb_bob", 5, 3.5, 2.5],
    "/robot_description": "<robot",
}

ARM_NODE = """\
import rclpy
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

JOINTS = ["elbow_joint", "shoulder_lift_joint", "shoulder_pan_joint"]


class Planner(Node):
    def __init__(self):
        super().__init__("planner")
        self.arm = self.create_publisher(JointTrajectory, "/arm_controller/joint_trajectory", 10)
        self.wrist = self.create_publisher(Float64MultiArray, "/wrist/commands", 10)
        self.start = self.create_timer(0.1, self.on_start)

    def on_start(self):
        self.start.cancel()
        end = JointTrajectoryPoint(positions=[0.6, -1.2, 0.5], velocities=[0.0] * 3, accelerations=[0.0] * 3)
        end.time_from_start.sec = 1
        self.arm.publish(JointTrajectory(joint_names=JOINTS, points=[end]))
        self.wrist.publish(Float64MultiArray(data=[0.3, -0.2]))


rclpy.init()
rclpy.spin(Planner())
"""

ARM = """\
name: NAME
robot: {model: ur5e_gripper, base: fixed, joints: {shoulder_lift_joint: -1.5}}
commands:
  ros2:
    nodes: [./FILE]
    controllers:
      arm_controller: {trajectory: ["shoulder_*", elbow_joint]}
      wrist: {position: [wrist_2_joint, wrist_1_joint]}
expect:
  - {joint: {name: elbow_joint, at_least: 0.59, at_most: 0.61}, after: 1.5 s}
  - {joint: {name: shoulder_pan_joint, at_least: 0.49, at_most: 0.51}, after: 1.5 s}
  - {joint: {name: wrist_2_joint, at_least: 0.29, at_most: 0.31}, after: 1.5 s}
  - {joint: {name: wrist_1_joint, at_least: -0.21, at_most: -0.19}, after: 1.5 s}
time_limit: 2 s
"""


def test_nodes_hear_the_robot_and_command_it(tmp_path: Path) -> None:
    (tmp_path / "listener.py").write_text(LISTENER)
    (tmp_path / "planner.py").write_text(ARM_NODE)
    (tmp_path / "typo.py").write_text(ARM_NODE.replace('["elbow_joint"', '["elbow_join"'))
    (tmp_path / "burger.sim.yml").write_text(BURGER)
    for name, file in (("arm", "planner.py"), ("typo", "typo.py")):
        (tmp_path / f"{name}.sim.yml").write_text(ARM.replace("NAME", name).replace("FILE", file))
    found = outcomes(tmp_path, ".", "--jobs", "2")
    assert {name: outcome["status"] for name, outcome in found.items()} == {
        "arm": "passed",
        "burger": "passed",
        "typo": "error",
    }, found
    (failure,) = found["typo"]["failures"]
    assert failure["message"] == (
        "at 0.1 s of sim time, '/planner' sent a bad command on /arm_controller/joint_trajectory: a trajectory of the "
        "unknown joint 'elbow_join'; did you mean 'elbow_joint'? (allowed: elbow_joint, shoulder_lift_joint, "
        "shoulder_pan_joint)"
    )
    heard = json.loads((tmp_path / "heard.json").read_text())
    assert heard["first"] == FIRST
    stamps = heard["stamps"]
    # The rate is 120 Hz, so that states come at each third tick; sensors at their own rates.
    assert stamps["/odom"] == [round(tick * 10**9 / 40) for tick in range(len(stamps["/odom"]))]
    assert stamps["/scan"] == [round(scan * 10**9 / 5) for scan in range(len(stamps["/scan"]))]
    assert stamps["/imu"] == [round(reading * 10**9 / 60) for reading in range(len(stamps["/imu"]))]
    assert {topic: len(times) for topic, times in stamps.items()} == {
        "/odom": 37,
        "/joint_states": 37,
        "/scan": 5,
        "/imu": 55,
        "/contact": 10,
        "/eye/image_raw": 10,
        "/eye/depth/image_raw": 10,
        "/eye/camera_info": 10,
        "/robot_description": 1,
    }
