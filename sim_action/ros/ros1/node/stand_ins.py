"""Programs that publish what they receive or know, for installations of ROS 1 that lack them."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import roslib.message
import rospy
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from sim_action.core.geometry import Pose, quaternion_from_rpy
from sim_action.core.workspace import Workspace
from sim_action.robot.model.robot_model import Joint, RobotModel
from sim_action.robot.reading.loading import load_model
from sim_action.ros.messages import transforms_message
from sim_action.ros.robot_topics import LinkFrames, PlacedFrame
from sim_action.ros.ros1.node.message_classes import filled, header
from sim_action.scenario.model import DrivenRobot

_DESCRIPTION: Final = "robot_description"


def _model() -> RobotModel:
    """Return the model that the parameter `robot_description` describes. Raises ModelError, KeyError."""
    text = str(rospy.get_param(rospy.search_param(_DESCRIPTION) or _DESCRIPTION))
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "robot.urdf").write_text(text, encoding="utf-8")
        return load_model(DrivenRobot(model="robot.urdf"), Workspace(Path(folder), Path(folder), allow_outside=True))


def _transforms(seconds: float, placed: Iterable[PlacedFrame]) -> TFMessage:
    return filled(TFMessage, transforms_message(seconds, placed))


def robot_state_publisher() -> int:
    """Publish the frames of links for each message of joint states, until the node is asked to leave."""
    rospy.init_node("robot_state_publisher")
    frames = LinkFrames.of(_model())
    interval = 1 / float(rospy.get_param("~publish_frequency", 50.0))
    static = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
    moving = rospy.Publisher("/tf", TFMessage, queue_size=None)
    static.publish(_transforms(0.0, frames.fixed))
    last = -interval

    def publish(message: Any) -> None:
        nonlocal last
        seconds = message.header.stamp.to_sec()
        transforms = list(frames.at(dict(zip(message.name, message.position, strict=False))))
        # Time goes back when a simulation starts again.
        if transforms and (seconds >= last + interval or seconds < last):
            last = seconds
            moving.publish(_transforms(seconds, transforms))

    rospy.Subscriber("joint_states", JointState, publish)
    rospy.spin()
    return 0


def joint_state_publisher() -> int:
    """Publish positions from `source_list`, else from `zeros`, at a fixed rate until asked to leave."""
    rospy.init_node("joint_state_publisher")
    joints = _model().moving_joints
    zeros = rospy.get_param("~zeros", {})
    positions = {joint.name: float(zeros.get(joint.name, _middle(joint))) for joint in joints}

    def hear(message: Any) -> None:
        heard = dict(zip(message.name, message.position, strict=False))
        positions.update({name: value for name, value in heard.items() if name in positions})

    for topic in rospy.get_param("~source_list", []):
        rospy.Subscriber(topic, JointState, hear)
    publisher = rospy.Publisher("joint_states", JointState, queue_size=5)
    for seconds in _times(float(rospy.get_param("~rate", 10))):
        for joint in joints:
            if joint.mimic is not None and joint.mimic.joint in positions:
                positions[joint.name] = joint.mimic.multiplier * positions[joint.mimic.joint] + joint.mimic.offset
        now = header(seconds, "")
        publisher.publish(JointState(header=now, name=list(positions), position=list(positions.values())))
    return 0


def _times(rate: float) -> Iterator[float]:
    """Yield the sim time in s, `rate` times per second, until the node is asked to leave."""
    sleeper = rospy.Rate(rate)
    with suppress(rospy.ROSInterruptException):
        while not rospy.is_shutdown():
            yield rospy.get_time()
            sleeper.sleep()


def _middle(joint: Joint) -> float:
    """Return 0, or the middle of the limits if they exclude it."""
    lower, upper = joint.lower, joint.upper
    is_outside = (lower is not None and lower > 0) or (upper is not None and upper < 0)
    return ((lower or 0.0) + (upper or 0.0)) / 2 if is_outside else 0.0


def static_transform_publisher() -> int:
    """Publish a frame until asked to leave: again and again on /tf, as tf does, or once, as tf2_ros does.

    The arguments are x, y, z, the rotation as yaw, pitch and roll or as a quaternion, the parent and the child; for
    tf, a period in ms follows.
    """
    rospy.init_node("static_transform_publisher", anonymous=True)
    words = rospy.myargv()[1:]
    period = float(words.pop()) / 1000 if words and words[-1].replace(".", "", 1).isdigit() else None
    try:
        *numbers, parent, child = words
        x, y, z, *turned = map(float, numbers)
        rotation = (
            (turned[0], turned[1], turned[2], turned[3])
            if len(turned) == len("xyzw")
            else quaternion_from_rpy(*reversed(turned))
        )
    except (TypeError, ValueError):
        sys.exit("usage: static_transform_publisher X Y Z (YAW PITCH ROLL | QX QY QZ QW) PARENT CHILD [PERIOD_MS]")
    frame = parent, child, Pose((x, y, z), rotation)
    publisher = rospy.Publisher("/tf_static" if period is None else "/tf", TFMessage, queue_size=1, latch=True)
    if period is None:
        publisher.publish(_transforms(0.0, [frame]))
        rospy.spin()
    else:
        for seconds in _times(1 / period):
            # It holds until the next one.
            publisher.publish(_transforms(seconds + period, [frame]))
    return 0


def relay() -> int:
    """Send each message of a topic on, by default to TOPIC_relay, until asked to leave."""
    rospy.init_node("relay", anonymous=True)
    topic, *to = rospy.myargv()[1:]
    publisher: Any = None

    def send(message: Any) -> None:
        nonlocal publisher
        # The first message decides the type.
        if publisher is None:
            kind = roslib.message.get_message_class(message._connection_header["type"])  # noqa: SLF001 - as rospy documents
            publisher = rospy.Publisher(to[0] if to else f"{topic}_relay", kind, queue_size=None)
        publisher.publish(publisher.data_class().deserialize(message._buff))  # noqa: SLF001 - as rospy documents

    rospy.Subscriber(topic, rospy.AnyMsg, send)
    rospy.spin()
    return 0
