"""Commands that nodes send: subscriptions, and the twists and joint targets that follow from their messages.

Joints are commanded as by the controllers of ros2_control, with the topics and messages of
joint_trajectory_controller and forward_command_controller.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Final, Protocol

from typing_extensions import override

from sim_action.commands.controller_answers import twist_problem
from sim_action.core.errors import ScriptError
from sim_action.core.geometry import Twist
from sim_action.core.records import dataclass, replace
from sim_action.core.wording import did_you_mean
from sim_action.robot.model.robot_model import Joint, Reading, RobotModel
from sim_action.ros.joint_commands import (
    JointCurve,
    TrajectoryPoint,
    Waypoint,
    curve_targets,
    joint_curves,
    resting,
    targets,
    within_limits,
)
from sim_action.ros.messages import Message, seconds_of, twist_of
from sim_action.ros.ros2.graph import USUAL, Graph, Qos, TopicEnd
from sim_action.state.command import Answer, JointTargets
from sim_action.state.observation import Observation

if TYPE_CHECKING:
    from sim_action.ros.ros2.spec import JointController

TWIST: Final = "geometry_msgs/msg/Twist"
STAMPED_TWIST: Final = "geometry_msgs/msg/TwistStamped"
_READINGS: Final[Mapping[str, Reading]] = {"position": "position", "velocity": "velocity", "effort": "effort"}
TRAJECTORY: Final = "trajectory_msgs/msg/JointTrajectory"
VALUES: Final = "std_msgs/msg/Float64MultiArray"
_REST: Final = 1.1920929e-07  # joint_trajectory_controller allows no more, as the single-precision epsilon


class BadMessage(Exception):
    """A message that cannot be a command; the text is the end of a sentence "a node sent ...: "."""


class Receiver(Protocol):
    """Takes the messages of a topic, and returns the commands that follow from them."""

    def take(self, message: Mapping[str, Any], seen: Observation) -> None:
        """Take a message at a moment. Raises BadMessage."""

    def answer(self, seen: Observation) -> Twist | JointTargets | None:
        """Return the command of a moment; None: as before."""


@dataclass(frozen=True, slots=True)
class Subscription:
    """A subscription to commands; `key`: in `topics:`; `open`: returns a receiver for a run."""

    key: str
    topic: str
    type: str
    open: Callable[[], Receiver]
    alternatives: tuple[str, ...] = ()
    qos: Qos = USUAL

    @property
    def types(self) -> tuple[str, ...]:
        """All types that it can have."""
        return (self.type, *self.alternatives)

    def matched(self, publishers: Sequence[TopicEnd]) -> Subscription:
        """Return this subscription with the type and the reliability of its publishers, before any message arrives.

        Without a publisher it stays as it is. Raises ScriptError if several nodes publish the topic, or no type fits.
        """
        nodes = sorted({end.node for end in publishers})
        if len(nodes) > 1:
            raise ScriptError(
                f"{len(nodes)} nodes publish {self.topic}, which commands the robot: {', '.join(nodes)}; let one node "
                "choose between them, or give the others other topics"
            )
        types = sorted({end.type for end in publishers})
        if len(types) > 1:
            raise ScriptError(f"'{nodes[0]}' publishes {self.topic} with several types: {', '.join(types)}")
        if types and types[0] not in self.types:
            raise ScriptError(
                f"'{nodes[0]}' publishes {self.topic} as {types[0]}, but the robot takes {' or '.join(self.types)}; "
                f"to leave this topic to others, give the robot another one with topics: {{{self.key}: ...}}"
            )
        is_reliable = all(end.reliability == "reliable" for end in publishers)
        qos = self.qos if is_reliable else replace(self.qos, reliability="best_effort")
        kind = types[0] if types else self.type
        return replace(self, type=kind, alternatives=tuple(other for other in self.types if other != kind), qos=qos)


def unsent(graph: Graph, subscriptions: Sequence[Subscription]) -> Iterator[str]:
    """Yield that no command arrived, and the topics of nodes that may have been meant."""
    yield f"no node sent a message on {' or '.join(subscription.topic for subscription in subscriptions)}"
    own = {subscription.topic for subscription in subscriptions}
    for subscription in subscriptions:
        others = [
            (topic, kind)
            for topic, ends in sorted(graph.publishers.items())
            for kind in subscription.types
            if topic not in own and any(end.type == kind for end in ends)
        ]
        if others:
            topics = ", ".join(f"{topic} ({kind})" for topic, kind in others)
            yield f"nodes publish {topics}; to use it, set topics: {{{subscription.key}: {others[0][0]}}}"


class ReceivedCommands:
    """The commands of all subscriptions during a run."""

    def __init__(self, subscriptions: Iterable[Subscription]) -> None:
        """Open a receiver for each subscription."""
        self._receivers = {subscription.topic: subscription.open() for subscription in subscriptions}

    def take(self, topic: str, message: Message, node: str, seen: Observation) -> None:
        """Take a message that a node sent. Raises ScriptError."""
        try:
            self._receivers[topic].take(message, seen)
        except BadMessage as problem:
            raise ScriptError(f"'{node}' sent a bad command on {topic}: {problem}") from None

    def answer(self, seen: Observation) -> Answer:
        """Return the commands of a moment."""
        twist: Twist | None = None
        targets: JointTargets | None = None
        for receiver in self._receivers.values():
            command = receiver.answer(seen)
            if isinstance(command, Twist):
                twist = command
            elif command is not None:
                targets = targets.updated_by(command) if targets else command
        if twist is not None and targets is not None:
            return twist, targets
        return targets if twist is None else twist


class TwistReceiver(Receiver):
    """Keeps the last twist."""

    def __init__(self) -> None:
        self._twist: Twist | None = None

    @override
    def take(self, message: Mapping[str, Any], seen: Observation) -> None:
        twist = twist_of(message)
        if problem := twist_problem(twist):
            raise BadMessage(problem)
        self._twist = twist

    @override
    def answer(self, seen: Observation) -> Twist | None:
        return self._twist


def twist_subscription(key: str, topic: str) -> Subscription:
    """Return the subscription to twists of the base."""
    return Subscription(key, topic, TWIST, TwistReceiver, (STAMPED_TWIST,))


def controller_subscription(name: str, topic: str, controller: JointController, model: RobotModel) -> Subscription:
    """Return the subscription to the commands of a controller."""
    joints = [model.joints_by_name[joint] for joint in controller.joints(model)]
    if controller.kind == "trajectory":
        return Subscription(name, topic, TRAJECTORY, partial(TrajectoryReceiver, joints))
    return Subscription(name, topic, VALUES, partial(ValuesReceiver, joints, _READINGS[controller.kind]))


def any_joints_subscription(key: str, topic: str, joints: Sequence[Joint]) -> Subscription:
    """Return a subscription to trajectories of any of some joints; the others are left as they are."""
    return Subscription(key, topic, TRAJECTORY, partial(TrajectoryReceiver, joints, needs_all=False))


class TrajectoryReceiver(Receiver):
    """Follows the last trajectory, as joint_trajectory_controller does. Joints hold still after its end.

    A controller that needs all its joints also holds them still before the first trajectory.
    """

    def __init__(self, joints: Sequence[Joint], *, needs_all: bool = True) -> None:
        self._joints = {joint.name: joint for joint in joints}
        self._needs_all = needs_all
        self._curves: dict[str, JointCurve] = {}

    @override
    def take(self, message: Mapping[str, Any], seen: Observation) -> None:
        names = list(message["joint_names"])
        self._check_names(names)
        begins = seconds_of(message["header"]["stamp"])
        points = list(_points(message, names, begins or seen.time))
        if self._needs_all:
            _check_end(points[-1], names)
        past = [point for point in points if point.time <= seen.time]
        if begins and len(past) == len(points):
            raise BadMessage(
                f"a trajectory that ended at {points[-1].time:g} s, before the present, {seen.time:g} s; let its stamp "
                "be the time of the node's clock, or 0 to start it at once"
            )
        # A trajectory that has begun goes on from its own points.
        start = [past[-1].of_joint(i) if past else self._state(name, seen) for i, name in enumerate(names)]
        if len(past) == len(points):
            self._curves |= {name: JointCurve((end,)) for name, end in zip(names, start, strict=True)}
        else:
            self._curves |= joint_curves(names, start, points[len(past) :])

    @override
    def answer(self, seen: Observation) -> JointTargets | None:
        if self._needs_all and not self._curves:
            self._curves = {name: JointCurve((self._state(name, seen),)) for name in self._joints}
        if not self._curves:
            return None
        return curve_targets(self._joints, self._curves, seen.time)

    def _state(self, name: str, seen: Observation) -> Waypoint:
        if name in self._curves:
            return self._curves[name].state(seen.time)
        return Waypoint(seen.time, seen.joints[name].position, 0.0, 0.0)

    def _check_names(self, names: Sequence[str]) -> None:
        if not names:
            raise BadMessage("a trajectory without joint_names")
        for name in names:
            if name not in self._joints:
                raise BadMessage(f"a trajectory of the unknown joint '{name}'{did_you_mean(name, self._joints)}")
        if len(set(names)) < len(names):
            raise BadMessage(f"a trajectory with a joint twice in joint_names: {', '.join(names)}")
        if self._needs_all and (missing := [name for name in self._joints if name not in names]):
            raise BadMessage(f"a trajectory without {', '.join(missing)}; it needs all joints of the controller")


def _points(message: Mapping[str, Any], names: Sequence[str], begins: float) -> Iterator[TrajectoryPoint]:
    """Yield the points of a message, for a trajectory that begins at a time in s. Raises BadMessage."""
    if not message["points"]:
        raise BadMessage("a trajectory without points")
    before = -math.inf
    for number, point in enumerate(message["points"]):
        motion = [list(point[group]) for group in ("positions", "velocities", "accelerations")]
        for group, values in zip(("positions", "velocities", "accelerations"), motion, strict=True):
            if values and len(values) != len(names):
                raise BadMessage(
                    f"a trajectory whose points[{number}] has {len(values)} {group} for {len(names)} joints"
                )
            _check_finite(values, f"points[{number}].{group}")
        if not motion[0]:
            raise BadMessage(f"a trajectory whose points[{number}] has no positions")
        if list(point.get("effort", ())):
            raise BadMessage(f"a trajectory whose points[{number}] has efforts, which no joint follows")
        time = seconds_of(point["time_from_start"])
        if time <= before:
            raise BadMessage(
                f"a trajectory whose points[{number}] is at {time:g} s, not later than the point before, at "
                f"{before:g} s"
            )
        before = time
        yield TrajectoryPoint(begins + time, *motion)


def _check_end(last: TrajectoryPoint, names: Sequence[str]) -> None:
    """Check that joints rest at the end of a trajectory, as joint_trajectory_controller does by default."""
    for name, velocity in zip(names, last.velocities, strict=False):
        if abs(velocity) > _REST:
            raise BadMessage(
                f"a trajectory at whose end joint '{name}' has the velocity {velocity:g}; joint_trajectory_controller "
                "refuses trajectories that do not end at rest"
            )


def _check_finite(values: Sequence[float], place: str) -> None:
    for index, value in enumerate(values):
        if not math.isfinite(value):
            raise BadMessage(f"{place}[{index}] is {value}, which is not finite")


class ValuesReceiver(Receiver):
    """Passes the last values on, as forward_command_controller does; before, positions hold, and velocities are 0."""

    def __init__(self, joints: Sequence[Joint], reading: Reading) -> None:
        self._joints, self._reading = joints, reading
        self._values: dict[str, float] | None = None

    @override
    def take(self, message: Mapping[str, Any], seen: Observation) -> None:
        values = list(message["data"])
        if len(values) != len(self._joints):
            names = ", ".join(joint.name for joint in self._joints)
            raise BadMessage(f"{len(values)} values in data for {len(self._joints)} joints: {names}")
        _check_finite(values, "data")
        self._values = {
            joint.name: within_limits(joint, self._reading, value)
            for joint, value in zip(self._joints, values, strict=True)
        }

    @override
    def answer(self, seen: Observation) -> JointTargets | None:
        if self._values is None:
            if self._reading == "effort":
                return None
            self._values = resting(self._reading, self._joints, seen.joints)
        return targets(self._reading, self._values)
