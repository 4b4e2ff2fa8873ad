"""A robot of a scenario among nodes: at each tick it tells them what there is to know, and takes what they command."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

import rospy
from geometry_msgs.msg import Transform, TransformStamped, Vector3
from geometry_msgs.msg import Twist as TwistMessage
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image, Imu, JointState, LaserScan
from std_msgs.msg import Bool, Header
from tf2_msgs.msg import TFMessage

from sim_action.commands.answers import problem_with
from sim_action.core import geometry
from sim_action.core.errors import ScriptError
from sim_action.core.geometry import Pose, Twist
from sim_action.robot.robot_model import RobotModel
from sim_action.ros.lockstep import Lockstep
from sim_action.ros.ros1.driving.launched_nodes import LaunchedNodes
from sim_action.ros.ros1.driving.spec import COMMANDS, JOINTS, ODOMETRY
from sim_action.ros.ros1.master import Master
from sim_action.ros.ros1.node.internal_sensors import states_in, states_sensor
from sim_action.ros.ros1.node.messages import (
    header,
    image_message,
    imu_message,
    in_frame_of,
    pose_message,
    scan_message,
    twist_message,
    twist_of,
)
from sim_action.ros.ros1.node.topics import GazeboTopics, Publisher, Subscription, Traffic
from sim_action.state.command import Answer
from sim_action.state.observation import Observation
from sim_action.state.readings import OdometryReading
from sim_action.world.scene import Fitting

NAME: Final = "/gazebo"
"""As what it stands in for is called."""

_TWIST: Final = "geometry_msgs/Twist"


@dataclass(frozen=True, slots=True)
class RobotSpec:
    """What is told of, and how.

    Attributes:
        rate: ticks in a second of sim time.
        topics: what they are of -> topic.
    """

    model: RobotModel
    rate: float
    sensors: Sequence[Fitting]
    topics: dict[str, str]


class RobotNode:
    """The live half of a source whose commands are given by nodes."""

    def __init__(self, nodes: LaunchedNodes, robot: RobotSpec, start_within: float) -> None:
        """Becomes a node of theirs. Raises ScriptError."""
        self._nodes, self._robot = nodes, robot
        rospy.init_node(NAME.strip("/"), disable_signals=True)
        self._master = Master(os.environ["ROS_MASTER_URI"], NAME)
        self._lockstep = Lockstep(
            self._master, NAME, nodes.launcher, rospy.is_shutdown, gone=nodes.note_gone, newcomers_within=start_within
        )
        traffic = Counter[str]()
        self._states = GazeboTopics(traffic)
        self._others = open_publishers(robot.model, robot.sensors, robot.topics, robot.rate, traffic)
        self._subscription = Subscription(robot.topics[COMMANDS], TwistMessage, twist_of, traffic)
        self._has_begun = False
        self._listeners = self._deaths = 0
        self._is_driven = False
        self.notes: list[str] = []
        self.sensors = (states_sensor(robot.rate, lambda: not self._has_begun or self._states.has_link_subscribers),)

    def tick(self, seen: Observation) -> Answer:
        """Tells nodes of a moment, waits until they have dealt with it, and returns what they say to it.

        Raises ScriptError if one of them has ended as it should not.
        """
        try:
            if not self._has_begun:
                self._begin()
            if self._tell(seen):
                self._lockstep.settle(seen.time)
            self._states.publish_time(seen.time)
            self._lockstep.settle(seen.time)
            self._look_after_leavers()
        except OSError:
            raise self._nodes.why_over() from None
        twist: geometry.Twist | None = self._subscription.value
        self._is_driven = self._is_driven or twist is not None
        if problem := problem_with(twist, self._robot.model):
            raise ScriptError(f"a node sent a bad command on {self._subscription.topic}: {problem}")
        return twist

    def close(self) -> None:
        """Ends the nodes, and notes what there is to say of them."""
        why = () if self._is_driven else self._why_not_driven()
        self._nodes.close()
        self.notes += [*self._nodes.notes, *self._lockstep.notes, *why]

    def _begin(self) -> None:
        """The clock does not start before everybody is there."""
        self._lockstep.begin(lambda: frozenset({self._subscription.topic}), lambda: False)
        # Whether something was heard depends on who came up first.
        self._subscription.begin()
        self._listeners, self._deaths = self._states.subscriber_count, self._nodes.deaths
        self._has_begun = True

    def _look_after_leavers(self) -> None:
        """A node that is about to end hangs up, and then takes its time by the wall's clock: sim time waits for it.

        Raises ScriptError if one has ended as it should not.
        """
        subscriber_count, deaths = self._states.subscriber_count, self._nodes.deaths
        # Which of the two is known first of one that has ended is not said.
        leaving = (self._listeners - subscriber_count) - (deaths - self._deaths)
        self._nodes.await_deaths(deaths + leaving)
        if leaving > 0 or subscriber_count > self._listeners:
            self._listeners, self._deaths = subscriber_count, self._nodes.deaths

    def _tell(self, seen: Observation) -> bool:
        """Returns whether somebody listens."""
        name, states = self._robot.model.name, states_in(seen)
        heard = [topic.tell(round(seen.time * self._robot.rate), seen) for topic in self._others]
        heard.append(self._states.publish_models({**states.bodies, name: (seen.pose, seen.twist)}))
        if states.links:
            bodies = {f"{body}::link": state for body, state in states.bodies.items()}
            links = {f"{name}::{link}": state for link, state in states.links.items()}
            heard.append(self._states.publish_links({**bodies, **links}))
        return any(heard)

    def _why_not_driven(self) -> tuple[str, ...]:
        """What to say of a robot that nobody has told anything; topics on which nodes talk of twists may be meant."""
        topic = self._subscription.topic
        try:
            twists = self._master.published(_TWIST)
        except (OSError, LookupError):
            twists = {}
        others = sorted(name for name, by in twists.items() if name != topic and by - {NAME})
        hint = f"; {_TWIST} is published on {', '.join(others)}" if others else ""
        advice = f"; to use it, set topics: {{{COMMANDS}: {others[0]}}}" if others else ""
        return (f"no node drove the robot: no message arrived on {topic}{hint}{advice}",)


# Hz, of what no sensor tells: as Gazebo's plugins are usually set.
_STATES_RATE: Final = 30.0
_ODOMETRY_FRAME: Final = "odom"


class TopicPublisher(Protocol):
    """Something that nodes can hear of."""

    def tell(self, tick: int, seen: Observation) -> bool:
        """Says what is new at a tick; returns whether somebody listens."""


def open_publishers(
    model: RobotModel, sensors: Sequence[Fitting], topics: Mapping[str, str], rate: float, traffic: Traffic
) -> list[TopicPublisher]:
    """All topics of a robot; `topics`: what they are of -> topic; `rate`: ticks in a second."""
    period = max(1, round(rate / _STATES_RATE))
    found: list[TopicPublisher] = [_Joints(Publisher(topics[JOINTS], JointState, traffic), model, period)]
    if ODOMETRY in topics:
        found.append(_Truth(_Odometry(topics[ODOMETRY], model.root, traffic), period))
    return [*found, *_sensors(sensors, topics, model.root, traffic)]


def _sensors(
    sensors: Sequence[Fitting], topics: Mapping[str, str], base: str, traffic: Traffic
) -> Iterator[TopicPublisher]:
    is_first = True
    for sensor in sensors:
        if sensor.kind == "odometry":
            odometry = _Odometry(topics[sensor.name], base, traffic, publishes_tf=is_first)
            is_first = False
            yield _Sensor(sensor.name, odometry.tell_reading)
        elif sensor.kind in _MESSAGES:
            kind, made = _MESSAGES[sensor.kind]
            yield _Sensor(sensor.name, _sending(Publisher(topics[sensor.name], kind, traffic), made, sensor))


class _Joints:
    """Where joints are, and what their motors do."""

    def __init__(self, publisher: Publisher, model: RobotModel, period: int) -> None:
        self._publisher, self._period = publisher, period
        self._names = [joint.name for joint in model.moving_joints]

    def tell(self, tick: int, seen: Observation) -> bool:
        """See Told.tell."""
        if tick % self._period or not self._publisher.has_subscribers or not self._names:
            return False
        positions, velocities, efforts = zip(*(seen.joints[name] for name in self._names), strict=True)
        self._publisher.send(JointState(header(seen.time, ""), self._names, positions, velocities, efforts))
        return True


class _Odometry:
    """Where a base is said to be, as a message and as a frame."""

    def __init__(self, topic: str, base: str, traffic: Traffic, *, publishes_tf: bool = True) -> None:
        self._base = base
        self._publisher = Publisher(topic, Odometry, traffic)
        self._frames = Publisher("/tf", TFMessage, traffic) if publishes_tf else None

    def tell(self, seconds: float, pose: Pose, twist: Twist) -> bool:
        """`twist`: in the frame of the base."""
        publishers = [
            publisher
            for publisher in (self._publisher, self._frames)
            if publisher is not None and publisher.has_subscribers
        ]
        if not publishers:
            return False
        message = Odometry(header=header(seconds, _ODOMETRY_FRAME), child_frame_id=self._base)
        message.pose.pose, message.twist.twist = pose_message(pose), twist_message(twist)
        self._publisher.send(message)
        if self._frames is not None:
            moved = Transform(Vector3(*pose.position_xyz), message.pose.pose.orientation)
            self._frames.send(TFMessage([TransformStamped(message.header, self._base, moved)]))
        return True

    def tell_reading(self, reading: OdometryReading) -> bool:
        """Of a sensor."""
        return self.tell(reading.time, reading.pose, reading.twist)


class _Truth:
    """Odometry that never errs."""

    def __init__(self, odometry: _Odometry, period: int) -> None:
        self._odometry, self._period = odometry, period

    def tell(self, tick: int, seen: Observation) -> bool:
        """See Told.tell."""
        if tick % self._period:
            return False
        return self._odometry.tell(seen.time, seen.pose, in_frame_of(seen.pose, seen.twist))


class _Sensor:
    """A sensor of the scenario, each of whose readings is told once."""

    def __init__(self, name: str, send: Callable[[Any], bool]) -> None:
        self._name, self._send = name, send
        self._last: float | None = None

    def tell(self, tick: int, seen: Observation) -> bool:
        """See Told.tell."""
        reading = seen.sensors[self._name]
        if reading.time == self._last:
            return False
        self._last = reading.time
        return self._send(reading)


def _sending(
    publisher: Publisher, made: Callable[[Any, Header, Fitting], Any], sensor: Fitting
) -> Callable[[Any], bool]:
    def send(reading: Any) -> bool:
        if not publisher.has_subscribers:
            return False
        publisher.send(made(reading, header(reading.time, sensor.link), sensor))
        return True

    return send


_MESSAGES: Final[Mapping[str, tuple[type[Any], Callable[[Any, Header, Fitting], Any]]]] = {
    "lidar": (LaserScan, lambda reading, head, sensor: scan_message(reading, head, 1 / sensor.rate)),
    "imu": (Imu, lambda reading, head, _: imu_message(reading, head)),
    "camera": (Image, lambda reading, head, _: image_message(reading, head)),
    "contact": (Bool, lambda reading, _, __: Bool(reading.touching)),
}
"""Kind of a sensor -> type of its messages, and what makes them."""
