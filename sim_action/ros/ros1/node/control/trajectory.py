"""Trajectory controllers: move joints along trajectories from a topic (wiki.ros.org/joint_trajectory_controller)."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any, Final

from trajectory_msgs.msg import JointTrajectory

from sim_action.robot.model.robot_model import Joint, Reading
from sim_action.ros.joint_commands import JointCurve, TrajectoryPoint, Waypoint, joint_curves, within_limits
from sim_action.ros.ros1.node.control import Controller, ControllerSetup
from sim_action.ros.ros1.node.control.joint_controllers import SERVO_NOTE
from sim_action.ros.ros1.node.topics import Subscription
from sim_action.ros.ros1.ros_control import INTERFACES
from sim_action.state.command import JointTargets
from sim_action.state.observation import Observation


def _controller(setup: ControllerSetup, interface: Reading) -> Controller:
    joints = setup.fitting("joints", interface)
    subscription = setup.wiring.subscribe(setup.topic("command"), JointTrajectory, lambda message: message)
    if interface != "position":
        setup.wiring.warn(f"the controller '{setup.parameters.space}': {SERVO_NOTE}")
    follower = TrajectoryFollower(setup, joints, subscription)
    return Controller(INTERFACES[interface], joints, follower, subscriptions=(subscription,), begin=follower.begin)


# `ros_control.CONTROLLERS` has the types.
open_on_position: Final = partial(_controller, interface="position")
open_on_velocity: Final = partial(_controller, interface="velocity")
open_on_effort: Final = partial(_controller, interface="effort")


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
        """See Mover."""
        if not self._curves:
            self._curves = {name: JointCurve((Waypoint(seconds, seen.joints[name].position),)) for name in self._joints}
        if self._subscription.value is not None and self._subscription.count != self._count:
            self._count = self._subscription.count
            self._take(self._subscription.value, seconds)
        now = {name: curve.at(seconds) for name, curve in self._curves.items()}
        return JointTargets(
            position={
                name: within_limits(self._joints[name], "position", position) for name, (position, _) in now.items()
            },
            velocity={
                name: within_limits(self._joints[name], "velocity", velocity) for name, (_, velocity) in now.items()
            },
        )

    def _take(self, told: Any, seconds: float) -> None:
        """Start a new trajectory; one without points ends the current one."""
        if not told.points:
            self._curves = {
                name: JointCurve((Waypoint(seconds, curve.at(seconds)[0]),)) for name, curve in self._curves.items()
            }
            return
        if set(told.joint_names) != set(self._joints):
            self._warn(
                f"{self._subscription.topic}: a trajectory of {', '.join(told.joint_names)} is ignored: "
                f"the joints of the controller are {', '.join(self._joints)}"
            )
            return
        begins = told.header.stamp.to_sec() or seconds
        start = [self._curves[name].state(seconds) for name in told.joint_names]
        points = [
            TrajectoryPoint(
                begins + point.time_from_start.to_sec(), point.positions, point.velocities, point.accelerations
            )
            for point in told.points
        ]
        try:
            self._curves = joint_curves(told.joint_names, start, points)
        except ValueError as error:
            self._warn(f"{self._subscription.topic}: a trajectory is ignored: {error}")
