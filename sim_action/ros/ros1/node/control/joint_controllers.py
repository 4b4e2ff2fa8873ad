"""Joint controllers: forward commands, follow trajectories from a topic, and publish joint states.

See wiki.ros.org/joint_trajectory_controller.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from sim_action.robot.model.robot_model import Joint, Reading
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
from sim_action.ros.messages import joint_states_message
from sim_action.ros.ros1.node.control import Controller, ControllerSetup
from sim_action.ros.ros1.node.plugins import Device
from sim_action.ros.ros1.node.topics import Subscription
from sim_action.ros.ros1.ros_control import INTERFACES
from sim_action.state.command import JointTargets
from sim_action.state.observation import Observation

SERVO_NOTE: Final = "its gains are not used; a servo of the engine, with the effort limit of the model, replaces them"
"""The note for controllers that would turn commands into efforts or velocities by gains."""


def open_one(setup: ControllerSetup) -> Controller:
    """Open a controller of one joint."""
    return _controller(setup, setup.fitting("joint", setup.interface)[:1], Float64, lambda message: (message.data,))


def open_group(setup: ControllerSetup) -> Controller:
    """Open a controller of several joints."""
    joints = setup.fitting("joints", setup.interface)
    return _controller(setup, joints, Float64MultiArray, lambda message: tuple(message.data))


def _controller(
    setup: ControllerSetup, joints: tuple[str, ...], kind: type[Any], read: Callable[[Any], tuple[float, ...]]
) -> Controller:
    subscription = setup.wiring.subscribe(setup.topic("command"), kind, read)
    interface, reading = setup.interface, next(reading for reading in INTERFACES if reading.title() in setup.type)
    # Servos make efforts: at 100 ticks per second, gains would shake light parts.
    if reading != interface:
        setup.wiring.warn(f"the controller '{setup.parameters.space}': {SERVO_NOTE}")
    joint_models = [setup.wiring.model.joints_by_name[name] for name in joints]
    forward = ForwardController(joint_models, reading, subscription, setup.wiring.warn)
    return Controller(INTERFACES[interface], joints, forward, subscriptions=(subscription,), begin=forward.begin)


class ForwardController:
    """Passes the last command on to joints. Before the first command, they hold still or are left free."""

    def __init__(
        self, joints: list[Joint], reading: Reading, subscription: Subscription, warn: Callable[[str], None]
    ) -> None:
        self._joints, self._reading, self._subscription, self._warn = joints, reading, subscription, warn
        self._resting: Mapping[str, float] | None = None

    def begin(self) -> None:
        """Ignore commands from before the start."""
        self._subscription.forget()
        self._resting = None

    def __call__(self, _: float, seen: Observation) -> JointTargets:
        """Return the targets of the last command; the joints hold still before it."""
        if self._resting is None:
            self._resting = resting(self._reading, self._joints, seen.joints)
        return targets(self._reading, self._commanded() or self._resting)

    def _commanded(self) -> Mapping[str, float] | None:
        values: tuple[float, ...] | None = self._subscription.value
        if values is None:
            return None
        if len(values) != len(self._joints):
            ignored = f"a command of {len(values)} numbers for {len(self._joints)} joints is ignored"
            self._warn(f"{self._subscription.topic}: {ignored}")
            return None
        pairs = zip(self._joints, values, strict=True)
        return {joint.name: within_limits(joint, self._reading, value) for joint, value in pairs}


def open_joint_states(setup: ControllerSetup) -> Controller:
    """Open joint_state_controller/JointStateController, for joints with a transmission, sorted by name."""
    moving = {joint.name for joint in setup.wiring.model.moving_joints}
    names = sorted(moving.intersection(setup.transmissions.interfaces)) or sorted(moving)
    publisher = setup.wiring.publisher(f"{setup.space}/joint_states", JointState)

    def publish(seconds: float, seen: Observation) -> None:
        if names:
            publisher.send(joint_states_message(seconds, {name: seen.joints[name] for name in names}))

    schedule = setup.wiring.controller_schedule(setup.parameters.space, setup.parameters.number("publish_rate", 50.0))
    return Controller("hardware_interface/JointStateInterface", device=Device(schedule, (publisher,), publish))


def open_trajectory(setup: ControllerSetup) -> Controller:
    """Open a controller that follows trajectories."""
    interface = setup.interface
    joints = setup.fitting("joints", interface)
    subscription = setup.wiring.subscribe(setup.topic("command"), JointTrajectory, lambda message: message)
    if interface != "position":
        setup.wiring.warn(f"the controller '{setup.parameters.space}': {SERVO_NOTE}")
    follower = TrajectoryFollower(setup, joints, subscription)
    return Controller(INTERFACES[interface], joints, follower, subscriptions=(subscription,), begin=follower.begin)


class TrajectoryFollower:
    """Follows the last trajectory. Before the first one and after its end, the joints hold still."""

    def __init__(self, setup: ControllerSetup, joints: tuple[str, ...], subscription: Subscription) -> None:
        self._joints: Mapping[str, Joint] = {name: setup.wiring.model.joints_by_name[name] for name in joints}
        self._warn, self._subscription, self._count = setup.wiring.warn, subscription, 0
        self._curves: dict[str, JointCurve] = {}

    def begin(self) -> None:
        """Ignore trajectories from before the start."""
        self._subscription.forget()
        self._count, self._curves = self._subscription.count, {}

    def __call__(self, seconds: float, seen: Observation) -> JointTargets:
        """Return the targets of the trajectory at a moment."""
        if not self._curves:
            self._curves = {name: JointCurve((Waypoint(seconds, seen.joints[name].position),)) for name in self._joints}
        if self._subscription.value is not None and self._subscription.count != self._count:
            self._count = self._subscription.count
            self._take(self._subscription.value, seconds)
        return curve_targets(self._joints, self._curves, seconds)

    def _take(self, message: Any, seconds: float) -> None:
        """Start a new trajectory; one without points ends the current one."""
        if not message.points:
            self._curves = {
                name: JointCurve((Waypoint(seconds, curve.at(seconds)[0]),)) for name, curve in self._curves.items()
            }
            return
        if set(message.joint_names) != set(self._joints):
            self._warn(
                f"{self._subscription.topic}: a trajectory of {', '.join(message.joint_names)} is ignored: "
                f"the joints of the controller are {', '.join(self._joints)}"
            )
            return
        begins = message.header.stamp.to_sec() or seconds
        start = [self._curves[name].state(seconds) for name in message.joint_names]
        points = [
            TrajectoryPoint(
                begins + point.time_from_start.to_sec(), point.positions, point.velocities, point.accelerations
            )
            for point in message.points
        ]
        try:
            self._curves = joint_curves(message.joint_names, start, points)
        except ValueError as error:
            self._warn(f"{self._subscription.topic}: a trajectory is ignored: {error}")
