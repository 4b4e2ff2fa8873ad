"""Plugins that drive: twists on a topic turn the wheels, and odometry says where that has led."""

from __future__ import annotations

from collections.abc import Iterable

import rospy
from geometry_msgs.msg import Transform, TransformStamped, Twist, Vector3
from nav_msgs.msg import Odometry
from tf2_msgs.msg import TFMessage

from sim_action.observation import Observation
from sim_action.ros1.gazebo_tags import Plugin
from sim_action.ros1.node.devices import Device, Wiring, period_of
from sim_action.ros1.node.messages import header, in_frame_of, pose_message, twist_message, twist_of


def open_drive(plugin: Plugin, wiring: Wiring) -> Iterable[Device]:
    """gazebo_ros_diff_drive, gazebo_ros_skid_steer_drive. Odometry is the truth, as theirs is unless they are told."""
    own = plugin.own
    _listen(plugin.topic("commandTopic", default="cmd_vel"), wiring)
    odometry = wiring.sender(plugin.topic("odometryTopic", default="odom"), Odometry)
    frame, child = own.text("odometryFrame", default="odom"), own.text("robotBaseFrame", default=wiring.model.root)
    moves_frames = own.flag("publishTf", "publishOdomTF", "broadcastTF", default=True)
    frames = wiring.sender("/tf", TFMessage) if moves_frames else None
    period = period_of(own.number("updateRate", "odometryRate", default=0.0))

    def publish(seconds: float, seen: Observation) -> None:
        message = Odometry(header=header(seconds, frame), child_frame_id=child)
        message.pose.pose = pose_message(seen.pose)
        message.twist.twist = twist_message(in_frame_of(seen.pose, seen.twist))
        odometry.send(message)
        if frames is not None:
            at = message.pose.pose
            moved = Transform(Vector3(at.position.x, at.position.y, at.position.z), at.orientation)
            frames.send(TFMessage([TransformStamped(message.header, child, moved)]))

    yield Device(period, (odometry, *([frames] if frames else [])), publish)


def _listen(topic: str, wiring: Wiring) -> None:
    told = wiring.told
    told.topics.add(topic)

    def listen(message: Twist) -> None:
        told.twist = twist_of(message)
        header = message._connection_header  # noqa: SLF001 - where rospy's documents say that it is
        told.is_latched = header.get("latching") == "1"
        wiring.traffic[topic] += 1

    rospy.Subscriber(topic, Twist, listen, queue_size=1, tcp_nodelay=True)
