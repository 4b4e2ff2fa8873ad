"""Scenarios that real nodes of ROS 2 drive, in lock-step."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ros.ros2.nodes import MOVER, needs_ros2, outcomes, scenario
from tests.soak import soaked

pytestmark = needs_ros2
RULE = "not-reproducible"

WALL_TIME = """\
import rclpy
from geometry_msgs.msg import Twist
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

rclpy.init()
node = Node("by_wall_time")
publisher = node.create_publisher(Twist, "cmd_vel", 10)
node.create_timer(0.001, lambda: publisher.publish(Twist()), clock=Clock(clock_type=ClockType.STEADY_TIME))
rclpy.spin(node)
"""
THREADS = MOVER.replace("spin(Mover())", "spin(Mover(), executor=MultiThreadedExecutor(3))")
THREADS = THREADS.replace("import ExternalShutdownException", "import ExternalShutdownException, MultiThreadedExecutor")
BUSY = WALL_TIME.replace("rclpy.spin(node)", "while True:\n    rclpy.spin_once(node, timeout_sec=0)")
DEAF = MOVER.replace("rclpy.init()", "rclpy.init(args=[])")

LOOP = """\
import random
import rclpy
from geometry_msgs.msg import Twist

rclpy.init()
node = rclpy.create_node("loop")
publisher = node.create_publisher(Twist, "cmd_vel", 10)
gain = float(input())
while rclpy.ok():
    rclpy.spin_once(node, timeout_sec=0.02)
    twist = Twist()
    twist.linear.x = gain * random.uniform(0.1, 0.3)
    publisher.publish(twist)
"""

# What it sends depends on the order of its loop, its callbacks and its timer; the rate and the sleep end at one tick.
RATES = """\
import threading
import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.duration import Duration
from sensor_msgs.msg import JointState

rclpy.init()
node = rclpy.create_node("rates")
publisher = node.create_publisher(Twist, "cmd_vel", 10)
mixed = [int(float(input()))]

def mix(number):
    mixed[0] = (mixed[0] * 31 + number) % 1009

node.create_subscription(JointState, "joint_states", lambda _: mix(4), 10)
node.create_subscription(Odometry, "odom", lambda _: mix(1), 10)
node.create_timer(0.1, lambda: mix(2))
threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()
rate = node.create_rate(20)
while rclpy.ok():
    mix(3)
    twist = Twist()
    twist.linear.x = 0.1 + mixed[0] / 10_000
    publisher.publish(twist)
    rate.sleep() if mixed[0] % 2 else node.get_clock().sleep_for(Duration(seconds=0.05))
"""


@pytest.mark.parametrize("loop", soaked(["rates", "spin_once"], short=["rates"]))
def test_loops_and_random_numbers_repeat(loop: str, tmp_path: Path) -> None:
    (tmp_path / "loop.py").write_text({"rates": RATES, "spin_once": LOOP}[loop])
    for name in ("first", "second"):
        scenario(tmp_path, name, "{nodes: [{file: ./loop.py, stdin: '1.5'}]}", seconds=0.5)
    found = outcomes(tmp_path, ".")
    assert {outcome["status"] for outcome in found.values()} == {"passed"}
    assert len({outcome["digest"] for outcome in found.values()}) == 1
    assert [warning for outcome in found.values() for warning in outcome["warnings"] if warning["rule"] == RULE] == []


# Those of the soak are waited for, 2 s and 10 s of wall time at each tick.
@pytest.mark.parametrize("names", ["wall threads paced", pytest.param("busy deaf", marks=pytest.mark.soak)])
def test_nodes_that_lockstep_cannot_order_are_named(names: str, tmp_path: Path) -> None:
    nodes = {"wall": WALL_TIME, "threads": THREADS, "busy": BUSY, "deaf": DEAF, "paced": MOVER}
    for name in names.split():
        text = nodes[name]
        (tmp_path / f"{name}.py").write_text(text)
        more = {"deaf": ", start_within: 2", "paced": ", pace: realtime"}.get(name, "")
        # Its lock-step is lost at once, and the rest takes long: it leaves no processor to others.
        scenario(tmp_path, name, f"{{nodes: [./{name}.py]{more}}}", seconds=0.2 if name == "busy" else 0.5)
    told = {
        name: (outcome["status"], [warning["message"] for warning in outcome["warnings"] if warning["rule"] == RULE])
        for name, outcome in outcomes(tmp_path, ".").items()
    }
    reasons = {
        "wall": "the node 'wall' ran although nothing was sent to it",
        "threads": "the node 'threads' handles messages on several threads",
        "busy": "because the node 'busy' was still busy after 10 s of wall time",
        "deaf": "the node 'deaf' did not subscribe to its clock within 2 s of wall time",
        "paced": "with pace: realtime, nodes run by the wall clock",
    }
    for name in names.split():
        status, messages = told[name]
        assert status == "passed"
        assert any(reasons[name] in message for message in messages), (name, messages)
