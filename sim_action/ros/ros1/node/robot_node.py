"""The robot of a scenario as a node: at each tick it publishes its state and takes commands."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import rospy
from geometry_msgs.msg import Twist as TwistMessage
from sensor_msgs.msg import Image, Imu, JointState, LaserScan
from std_msgs.msg import Bool

from sim_action.commands.controller_answers import twist_problem
from sim_action.core import geometry
from sim_action.core.errors import ScriptError
from sim_action.robot.model.robot_model import RobotModel
from sim_action.ros.messages import Message, image_message, imu_message, joint_states_message, scan_message
from sim_action.ros.robot_topics import COMMANDS, JOINTS, ODOMETRY, Schedule, in_frame_of, topics_of
from sim_action.ros.ros1.lockstep import Lockstep
from sim_action.ros.ros1.master import Master
from sim_action.ros.ros1.node.internal_parts import states_in, states_sensor
from sim_action.ros.ros1.node.message_classes import twist_of
from sim_action.ros.ros1.node.topics import (
    GazeboTopics,
    OdometryPublisher,
    Publisher,
    Subscription,
    Traffic,
    WallClockWatch,
)
from sim_action.state.command import Answer
from sim_action.state.observation import Observation
from sim_action.state.readings import OdometryReading
from sim_action.state.reproducibility import Transcript
from sim_action.world.scene import Fitting, Scene

if TYPE_CHECKING:
    from sim_action.ros.ros1.command_source.launched_nodes import LaunchedNodes
    from sim_action.ros.ros1.command_source.spec import RosNodes

NAME: Final = "/gazebo"  # the node name that Gazebo has
_TWIST: Final = "geometry_msgs/Twist"

# The rate of topics without a sensor, as Gazebo's plugins usually have it.
_STATES_RATE_HZ: Final = 30.0
_ODOMETRY_FRAME: Final = "odom"

_MESSAGES: Final[Mapping[str, tuple[type[Any], Callable[[Any, Fitting], Message]]]] = {
    "lidar": (LaserScan, lambda each, sensor: scan_message(each.time, sensor.link, each, 1 / sensor.rate)),
    "imu": (Imu, lambda each, sensor: imu_message(each.time, sensor.link, each, (0.0, 0.0))),
    "camera": (Image, lambda each, sensor: image_message(each.time, sensor.link, each.rgb)),
    "contact": (Bool, lambda each, _: {"data": each.touching}),
}
"""Kind of a sensor -> message type and conversion."""


class RobotNode:
    """The controller of a scenario that nodes drive."""

    def __init__(self, nodes: LaunchedNodes, scene: Scene, spec: RosNodes, rate: float) -> None:
        """Become one of the nodes; `rate`: ticks per second. Raises ScriptError."""
        self._nodes, self._model, self._rate = nodes, scene.model, rate
        topics = topics_of(scene.sensors, spec.topics)
        rospy.init_node(NAME.strip("/"), disable_signals=True)
        self._master = Master(os.environ["ROS_MASTER_URI"], NAME)
        self._lockstep = Lockstep(
            self._master,
            NAME,
            nodes.launcher,
            rospy.is_shutdown,
            gone=nodes.await_exits,
            newcomers_within=spec.start_within,
        )
        self.not_reproducible = self._lockstep.not_reproducible
        self._traffic = traffic = Traffic()
        self.transcript = Transcript()
        self._states = GazeboTopics(traffic)
        self._others = open_publishers(scene.model, scene.sensors, topics, rate, traffic)
        self._subscription = Subscription(topics[COMMANDS], TwistMessage, twist_of, traffic)
        self._wall_clock = WallClockWatch(self._traffic, self._lockstep)
        self._has_begun = False
        self._listeners = self._exit_count = 0
        self._is_driven = False
        self.notes: list[str] = []
        self.sensors = (states_sensor(rate, lambda: not self._has_begun or self._states.has_link_subscribers),)

    def tick(self, seen: Observation) -> Answer:
        """Publish a moment, let the nodes handle it, and return the last command. Raises ScriptError."""
        try:
            if not self._has_begun:
                self._begin()
            self._wall_clock.look()
            self._publish(seen)
            self._lockstep.deliver(seen.time, self._traffic.undelivered())
            self._await_leaving_nodes()
        except OSError:
            raise self._nodes.end_error() from None
        self._traffic.move_to(self.transcript, seen.time)
        twist: geometry.Twist | None = self._subscription.value
        self._is_driven = self._is_driven or twist is not None
        if twist is not None and (problem := twist_problem(twist)):
            raise ScriptError(f"a node sent a bad command on {self._subscription.topic}: {problem}")
        return twist

    def close(self) -> None:
        """End the nodes, and collect notes."""
        why = () if self._is_driven else self._why_not_driven()
        self._nodes.close()
        self.notes += [*self._nodes.notes, *self._lockstep.notes, *why]

    def _begin(self) -> None:
        """Hold the clock until all nodes are up."""
        self._lockstep.begin(lambda: frozenset({self._subscription.topic}), lambda: False)
        # Commands from before the start arrive or not, depending on which node came up first.
        self._subscription.begin()
        self._traffic.begin()
        self._listeners, self._exit_count = self._states.subscriber_count, self._nodes.exit_count
        self._has_begun = True

    def _await_leaving_nodes(self) -> None:
        """Hold sim time while a node ends: it disconnects first and then ends by the wall clock. Raises ScriptError."""
        subscriber_count, exit_count = self._states.subscriber_count, self._nodes.exit_count
        # A node's disconnection and its exit become known in any order.
        leaving = (self._listeners - subscriber_count) - (exit_count - self._exit_count)
        self._nodes.await_exit_count(exit_count + leaving)
        if leaving > 0 or subscriber_count > self._listeners:
            self._listeners, self._exit_count = subscriber_count, self._nodes.exit_count

    def _publish(self, seen: Observation) -> None:
        """Publish a moment, the clock last."""
        name, states = self._model.name, states_in(seen)
        for publish in self._others:
            publish(round(seen.time * self._rate), seen)
        self._states.publish_models({**states.bodies, name: (seen.pose, seen.twist)})
        if states.links:
            bodies = {f"{body}::link": state for body, state in states.bodies.items()}
            links = {f"{name}::{link}": state for link, state in states.links.items()}
            self._states.publish_links({**bodies, **links})
        self._states.publish_time(seen.time)

    def _why_not_driven(self) -> tuple[str, ...]:
        """Return the note on a robot that no node drove, with other topics of type Twist."""
        topic = self._subscription.topic
        try:
            twists = self._master.published(_TWIST)
        except (OSError, LookupError):
            twists = {}
        others = sorted(name for name, by in twists.items() if name != topic and by - {NAME})
        hint = f"; {_TWIST} is published on {', '.join(others)}" if others else ""
        advice = f"; to use it, set topics: {{{COMMANDS}: {others[0]}}}" if others else ""
        return (f"no node drove the robot: no message arrived on {topic}{hint}{advice}",)


Publish = Callable[[int, Observation], None]  # function that publishes what is new at a tick, if a node subscribes


def open_publishers(
    model: RobotModel, sensors: Sequence[Fitting], topics: Mapping[str, str], rate: float, traffic: Traffic
) -> list[Publish]:
    """Return the publishers of a robot; `topics`: key -> topic; `rate`: ticks per second."""
    schedule = Schedule.of(_STATES_RATE_HZ, rate)
    publishers = [_joint_states(Publisher(topics[JOINTS], JointState, traffic), model, schedule)]
    if ODOMETRY in topics:
        publishers.append(_truth(OdometryPublisher(topics[ODOMETRY], (_ODOMETRY_FRAME, model.root), traffic), schedule))
    return [*publishers, *_sensors(sensors, topics, model.root, traffic)]


def _sensors(sensors: Sequence[Fitting], topics: Mapping[str, str], base: str, traffic: Traffic) -> Iterator[Publish]:
    is_first = True
    for sensor in sensors:
        if sensor.kind == "odometry":
            frames = (_ODOMETRY_FRAME, base)
            odometry = OdometryPublisher(topics[sensor.name], frames, traffic, publishes_tf=is_first)
            is_first = False
            yield _once(sensor.name, partial(_send_odometry, odometry))
        elif sensor.kind in _MESSAGES:
            kind, made = _MESSAGES[sensor.kind]
            yield _once(sensor.name, partial(_send, Publisher(topics[sensor.name], kind, traffic), made, sensor))


def _joint_states(publisher: Publisher, model: RobotModel, schedule: Schedule) -> Publish:
    names = [joint.name for joint in model.moving_joints]

    def publish(tick: int, seen: Observation) -> None:
        if names and schedule.is_due(tick) and publisher.has_subscribers:
            publisher.send(joint_states_message(seen.time, {name: seen.joints[name] for name in names}))

    return publish


def _truth(odometry: OdometryPublisher, schedule: Schedule) -> Publish:
    def publish(tick: int, seen: Observation) -> None:
        if schedule.is_due(tick):
            odometry.send(seen.time, seen.pose, in_frame_of(seen.pose, seen.twist))

    return publish


def _once(name: str, send: Callable[[Any], None]) -> Publish:
    """Return a function that sends each reading of a sensor once."""
    last: float | None = None

    def publish(_: int, seen: Observation) -> None:
        nonlocal last
        reading = seen.sensors[name]
        if reading.time != last:
            last = reading.time
            send(reading)

    return publish


def _send_odometry(odometry: OdometryPublisher, reading: OdometryReading) -> None:
    odometry.send(reading.time, reading.pose, reading.twist)


def _send(publisher: Publisher, made: Callable[[Any, Fitting], Message], sensor: Fitting, reading: Any) -> None:
    if publisher.has_subscribers:
        publisher.send(made(reading, sensor))
