"""The robot of a scenario as a node: at each tick it publishes its state and takes commands."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import rospy
from geometry_msgs.msg import Twist as TwistMessage
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image, Imu, JointState, LaserScan
from std_msgs.msg import Bool
from tf2_msgs.msg import TFMessage

from sim_action.commands.controller_answers import twist_problem
from sim_action.core import geometry
from sim_action.core.errors import ScriptError
from sim_action.robot.model.robot_model import RobotModel
from sim_action.ros.messages import (
    Message,
    Messages,
    each_reading,
    image_message,
    imu_message,
    joint_states_message,
    odometry_message,
    scan_message,
    transforms_message,
    when_due,
)
from sim_action.ros.robot_topics import COMMANDS, JOINTS, ODOMETRY, Schedule, in_frame_of, topics_of
from sim_action.ros.ros1.launch.ros_patches import note_misfits
from sim_action.ros.ros1.node.internal_parts import states_in, states_sensor
from sim_action.ros.ros1.node.message_classes import twist_of
from sim_action.ros.ros1.node.topics import GazeboTopics, Publisher, Subscription, Traffic, WallClockWatch
from sim_action.state.command import Answer
from sim_action.state.observation import Observation
from sim_action.state.readings import OdometryReading
from sim_action.state.trace import Transcript
from sim_action.world.scene import Fitting, Scene

if TYPE_CHECKING:
    from sim_action.ros.ros1.command_source.launched_nodes import LaunchedNodes
    from sim_action.ros.ros1.command_source.spec import RosNodes

NAME: Final = "/gazebo"  # the node name that Gazebo has
_TWIST: Final = "geometry_msgs/Twist"

# The rate of topics without a sensor, as Gazebo's plugins usually have it.
_STATES_RATE_HZ: Final = 30.0
_ODOMETRY_FRAME: Final = "odom"
_TRANSFORMS: Final = "/tf"

_MESSAGES: Final[Mapping[str, tuple[type[Any], Callable[[Fitting, tuple[str, str], Any], Message]]]] = {
    "lidar": (LaserScan, lambda sensor, _, reading: scan_message(reading.time, sensor.link, reading, 1 / sensor.rate)),
    "imu": (Imu, lambda sensor, _, reading: imu_message(reading.time, sensor.link, reading, (0.0, 0.0))),
    "odometry": (
        Odometry,
        lambda _, frames, reading: odometry_message(reading.time, frames, reading.pose, reading.twist),
    ),
    "camera": (Image, lambda sensor, _, reading: image_message(reading.time, sensor.link, reading.rgb)),
    "contact": (Bool, lambda _sensor, _frames, reading: {"data": reading.touching}),
}
"""Kind of a sensor -> message type, and its conversion from sensor, frames of odometry and reading."""


class RobotNode:
    """The controller of a scenario that nodes drive."""

    def __init__(self, nodes: LaunchedNodes, scene: Scene, spec: RosNodes, rate: float) -> None:
        """Become one of the nodes; `rate`: ticks per second. Raises ScriptError."""
        self._nodes, self._model, self._rate = nodes, scene.model, rate
        topics = topics_of(scene.sensors, spec.topics)
        note_misfits(vars(rospy.impl.tcpros_pubsub))
        rospy.init_node(NAME.strip("/"), disable_signals=True)
        self._traffic = traffic = Traffic()
        self._states = GazeboTopics(traffic)
        self._lockstep = self._states.lockstep(
            nodes.launcher, gone=nodes.await_exits, newcomers_within=spec.start_within
        )
        self.not_reproducible = self._lockstep.not_reproducible
        self.transcript = Transcript()
        rows = published(scene.model, scene.sensors, topics, rate)
        self._others = [(Publisher(topic, kind, traffic), messages) for topic, kind, messages in rows]
        self._subscription = Subscription(topics[COMMANDS], TwistMessage, twist_of, traffic)
        self._wall_clock = WallClockWatch(self._traffic, self._lockstep)
        self._has_begun = False
        self._is_driven = False
        self.notes: list[str] = []
        self.sensors = (states_sensor(rate, lambda: not self._has_begun or self._states.has_link_subscribers),)

    def tick(self, seen: Observation) -> Answer:
        """Publish a moment, let the nodes handle it, and return the last command. Raises ScriptError."""
        try:
            if not self._has_begun:
                # Hold the clock until all nodes are up.
                self._lockstep.begin(lambda: frozenset({self._subscription.topic}), lambda: False)
                # Commands from before the start arrive or not, depending on which node came up first.
                self._subscription.begin()
                self._traffic.begin()
                self._has_begun = True
            self._wall_clock.look()
            self._publish(seen)
            self._lockstep.deliver(seen.time, self._traffic.undelivered())
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

    def _publish(self, seen: Observation) -> None:
        """Publish a moment, the clock last."""
        name, states = self._model.name, states_in(seen)
        for publisher, messages in self._others:
            if (message := messages(round(seen.time * self._rate), seen)) is not None:
                publisher.send(message)
        self._states.publish_models({**states.bodies, name: (seen.pose, seen.twist)})
        if links := states.links_of_models(name):
            self._states.publish_links(links)
        self._states.publish_time(seen.time)

    def _why_not_driven(self) -> tuple[str, ...]:
        """Return the note on a robot that no node drove, with other topics of type Twist."""
        topic = self._subscription.topic
        try:
            twists = self._lockstep.master.published(_TWIST)
        except (OSError, LookupError):
            twists = {}
        others = sorted(name for name, by in twists.items() if name != topic and by - {NAME})
        hint = f"; {_TWIST} is published on {', '.join(others)}" if others else ""
        advice = f"; to use it, set topics: {{{COMMANDS}: {others[0]}}}" if others else ""
        return (f"no node drove the robot: no message arrived on {topic}{hint}{advice}",)


def published(
    model: RobotModel, sensors: Sequence[Fitting], topics: Mapping[str, str], rate: float
) -> Iterator[tuple[str, type[Any], Messages]]:
    """Yield topic, type and messages of all that a robot publishes; `topics`: by key; `rate`: ticks per second."""
    schedule, frames = Schedule.of(_STATES_RATE_HZ, rate), (_ODOMETRY_FRAME, model.root)
    names = [joint.name for joint in model.moving_joints]

    def joint_states(seen: Observation) -> Message:
        return joint_states_message(seen.time, {name: seen.joints[name] for name in names})

    def truth(seen: Observation) -> Message:
        return odometry_message(seen.time, frames, seen.pose, in_frame_of(seen.pose, seen.twist))

    def frame(seen: Observation | OdometryReading) -> Message:
        return transforms_message(seen.time, [(*frames, seen.pose)])

    yield topics[JOINTS], JointState, when_due(schedule, joint_states) if names else lambda _tick, _seen: None
    if ODOMETRY in topics:
        yield topics[ODOMETRY], Odometry, when_due(schedule, truth)
        yield _TRANSFORMS, TFMessage, when_due(schedule, frame)
    first = next((sensor for sensor in sensors if sensor.kind == "odometry"), None)
    for sensor in (sensor for sensor in sensors if sensor.kind in _MESSAGES):
        kind, made = _MESSAGES[sensor.kind]
        yield topics[sensor.name], kind, each_reading(sensor.name, partial(made, sensor, frames))
        if sensor is first:
            yield _TRANSFORMS, TFMessage, each_reading(sensor.name, frame)
