"""Chains of nodes of ROS 1 with timers and sensors: the same digest in every run, because messages come one by one."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.integration.conftest import outcomes
from tests.integration.test_examples import sim_action
from tests.ros.ros1.launches import needs_ros, package
from tests.soak import soaked

pytestmark = needs_ros

HEAD = """\
#!/usr/bin/env python
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

"""
# A planner closes the loop, and its timer is due at the same ticks as that of the smoother, which drives.
PLANNER = f"""{HEAD}
x = [0.0]
rospy.init_node("planner")
commands = rospy.Publisher("/cmd_raw", Twist, queue_size=10)
rospy.Subscriber("/odom", Odometry, lambda message: x.__setitem__(0, message.pose.pose.position.x))

def plan(_):
    twist = Twist()
    twist.linear.x = max(0.0, min(0.2, 2.0 * (0.8 - x[0])))
    commands.publish(twist)

rospy.Timer(rospy.Duration(0.1), plan)
rospy.spin()
"""
SMOOTHER = f"""{HEAD}
speed = {{"now": 0.0, "wanted": 0.0}}
rospy.init_node("smoother")
commands = rospy.Publisher("/cmd_vel", Twist, queue_size=10)
rospy.Subscriber("/cmd_raw", Twist, lambda message: speed.__setitem__("wanted", message.linear.x))

def smooth(_):
    speed["now"] += 0.2 * (speed["wanted"] - speed["now"])
    twist = Twist()
    twist.linear.x = speed["now"]
    commands.publish(twist)

rospy.Timer(rospy.Duration(0.02), smooth)
rospy.spin()
"""
# Sends its number after each message of a sensor.
RELAY = f"""{HEAD}
rospy.init_node("relay")
numbers = rospy.Publisher("/numbers", Float64, queue_size=10)
kind = {{"/odom": Odometry, "/joint_states": JointState}}[rospy.get_param("~topic")]
number = Float64(rospy.get_param("~number"))
rospy.Subscriber(rospy.get_param("~topic"), kind, lambda _: (sum(range(20_000)), numbers.publish(number)))
rospy.spin()
"""
# Drives by the order in which the numbers arrived.
MIXER = f"""{HEAD}
mixed = [1]
rospy.init_node("mixer")
commands = rospy.Publisher("/cmd_vel", Twist, queue_size=10)

def mix(message):
    mixed[0] = (mixed[0] * 31 + int(message.data)) % 1009
    twist = Twist()
    twist.linear.x = 0.1 + mixed[0] / 10_000
    commands.publish(twist)

rospy.Subscriber("/numbers", Float64, mix)
rospy.spin()
"""
NODES = {"planner.py": PLANNER, "smoother.py": SMOOTHER, "relay.py": RELAY, "mixer.py": MIXER}
TIMERS = "nodes/planner.py, nodes/smoother.py"
SENSORS = "nodes/mixer.py, " + ", ".join(
    f"{{package: nodes, type: relay.py, name: relay_{number}, params: {{topic: {topic}, number: {number}}}}}"
    for number, topic in ((1, "/odom"), (2, "/joint_states"), (3, "/odom"))
)


@pytest.mark.parametrize("runs", soaked([2, 20], short=[2]))
@pytest.mark.parametrize("nodes", [pytest.param(TIMERS, id="timers"), pytest.param(SENSORS, id="sensors")])
def test_a_chain_of_nodes_has_one_digest(nodes: str, runs: int, tmp_path: Path) -> None:
    chain(tmp_path, nodes)
    done = sim_action(tmp_path, "run", "ws/s.sim.yml", "--no-report", "--repeat", str(runs))
    (outcome,) = outcomes(tmp_path)
    assert done.returncode == 0, done.stdout
    assert outcome["repeats"] == {"count": runs, "agreed": runs, "digests": 1, "replay": None}


def chain(folder: Path, nodes: str) -> None:
    (folder / ".git").mkdir()
    package(folder / "ws", "nodes", NODES)
    text = "name: chain\nrobot: {model: turtlebot3_burger}\n"
    expected = "expect:\n  - travel: {at_least: 0.02 m}\nduration: 0.8 s\ntime_limit: 0.8 s\n"
    (folder / "ws/s.sim.yml").write_text(f"{text}commands:\n  ros1: {{nodes: [{nodes}]}}\n{expected}")
