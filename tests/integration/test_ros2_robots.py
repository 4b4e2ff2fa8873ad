"""Two robots in one lock-step, whose nodes of ROS 2 hear each other."""

from __future__ import annotations

import json
from pathlib import Path

from tests.ros.ros2.nodes import needs_ros2, outcomes

pytestmark = needs_ros2

# The leader goes faster the nearer the follower is; the follower keeps 0.5 m behind the leader.
NODE = """\
import json
import os
import sys

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import JointState, LaserScan


class Driver(Node):
    def __init__(self, leads):
        super().__init__("driver")
        self.leads = leads
        self.own = self.other = None
        self.heard = set()
        self.publisher = self.create_publisher(Twist, "cmd_vel", 10)
        self.create_subscription(Odometry, "odom", self.on_own, 10)
        self.create_subscription(Odometry, "/robot2/odom" if leads else "/odom", self.on_other, 10)
        self.create_subscription(JointState, "joint_states", lambda message: self.heard.add("joint_states"), 10)
        self.create_subscription(LaserScan, "scan", lambda message: self.heard.add(message.header.frame_id), 10)
        self.create_timer(0.05, self.on_timer)

    def on_own(self, message):
        self.own = message.pose.pose.position.x
        self.heard |= {message.header.frame_id, message.child_frame_id}

    def on_other(self, message):
        self.other = message.pose.pose.position.x

    def on_timer(self):
        if self.own is None or self.other is None:
            return
        gap = abs(self.own - self.other)
        twist = Twist()
        twist.linear.x = max(0.0, 0.3 * (1.5 - gap) if self.leads else gap - 0.5)
        self.publisher.publish(twist)
        if self.get_clock().now().nanoseconds == 10**9:
            if not self.leads:
                self.get_logger().error("the leader is too fast")
            path = os.path.join(os.path.dirname(__file__), f"{self.get_name()}-{self.leads}.json")
            with open(path, "w") as file:
                json.dump([self.get_fully_qualified_name(), sorted(self.heard)], file)


rclpy.init()
rclpy.spin(Driver(sys.argv[1] == "leads"))
"""

SCENARIO = """\
name: NAME
robot: {model: turtlebot3_burger}
sensors: [{lidar: {rays: 8}, link: base_scan, name: eye}]
world:
  actors:
    - name: second
      model: turtlebot3_burger
      pose: {x: -1}
      sensors: [{lidar: {rays: 8}, link: base_scan, name: eye}]
      commands:
        ros2: {namespace: robot2, nodes: [{file: ./driver.py, args: follows}]}
commands:
  ros2: {nodes: [{file: ./driver.py, args: leads}]}
expect:
  - travel: {at_least: 10 cm}
  - stl: eventually second.x > -0.8
duration: 1.1 s
time_limit: 1.1 s
"""


def test_robots_that_hear_each_other_repeat(tmp_path: Path) -> None:
    (tmp_path / "driver.py").write_text(NODE)
    for name in ("first", "second"):
        (tmp_path / f"{name}.sim.yml").write_text(SCENARIO.replace("NAME", name))
    found = outcomes(tmp_path, ".")
    assert [outcome["status"] for outcome in found.values()] == ["passed"] * 2, found
    line = SCENARIO[: SCENARIO.index("namespace")].count("\n")
    for outcome in found.values():
        (warning,) = outcome["warnings"]
        assert "the leader is too fast" in warning["message"]
        assert (warning["rule"], warning["location"]["line"]) == ("logged-error", line)
    assert len({outcome["digest"] for outcome in found.values()}) == 1
    (leader, of_leader), (follower, of_follower) = (
        json.loads((tmp_path / f"driver-{leads}.json").read_text()) for leads in (True, False)
    )
    assert (leader, follower) == ("/driver", "/robot2/driver")
    assert {"odom", "base_footprint", "base_scan", "joint_states"} == set(of_leader)
    assert {"robot2/odom", "robot2/base_footprint", "robot2/base_scan", "joint_states"} == set(of_follower)
