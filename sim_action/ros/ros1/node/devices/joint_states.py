"""The plugin that tells where joints are."""

from __future__ import annotations

from collections.abc import Iterable

from sensor_msgs.msg import JointState

from sim_action.ros.ros1.gazebo_tags import Plugin
from sim_action.ros.ros1.node.devices import Device, Wiring, period_of
from sim_action.ros.ros1.node.messages import header
from sim_action.state.observation import Observation


def open_joint_states(plugin: Plugin, wiring: Wiring) -> Iterable[Device]:
    """gazebo_ros_joint_state_publisher; without names, all that move."""
    sender = wiring.sender(plugin.topic("topicName", default="joint_states"), JointState)
    moving = [joint.name for joint in wiring.model.moving_joints]
    names = [name for name in plugin.own.texts("jointName") if name in moving] or moving

    def publish(seconds: float, seen: Observation) -> None:
        positions, velocities, efforts = zip(*(seen.joints[name] for name in names), strict=True)
        sender.send(JointState(header(seconds, ""), names, positions, velocities, efforts))

    yield Device(period_of(plugin.own.number("updateRate", default=0.0)), (sender,), publish)
