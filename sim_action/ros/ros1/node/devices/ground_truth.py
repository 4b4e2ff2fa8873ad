"""The plugin that tells where a link really is."""

from __future__ import annotations

from collections.abc import Iterable

from nav_msgs.msg import Odometry

from sim_action.ros.ros1.gazebo_tags import Plugin
from sim_action.ros.ros1.node.devices import Device, Wiring, period_of
from sim_action.ros.ros1.node.messages import header, pose_message, twist_message
from sim_action.ros.ros1.node.world_states import states_in
from sim_action.state.observation import Observation


def open_ground_truth(plugin: Plugin, wiring: Wiring) -> Iterable[Device]:
    """gazebo_ros_p3d."""
    link, frame = plugin.own.text("bodyName", default=wiring.model.root), plugin.own.text("frameName", default="world")
    sender = wiring.sender(plugin.topic("topicName", default="odom"), Odometry)

    def publish(seconds: float, seen: Observation) -> None:
        pose, twist = states_in(seen).links[link]
        message = Odometry(header=header(seconds, frame), child_frame_id=link)
        message.pose.pose, message.twist.twist = pose_message(pose), twist_message(twist)
        sender.send(message)

    yield Device(period_of(plugin.own.number("updateRate", default=0.0)), (sender,), publish, reads_links=True)
