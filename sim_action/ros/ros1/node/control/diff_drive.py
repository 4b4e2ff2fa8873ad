"""The diff drive controller: turns the wheels of two sides by a twist (wiki.ros.org/diff_drive_controller)."""

from __future__ import annotations

import math
from typing import Final

from geometry_msgs.msg import Twist

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.core.records import dataclass
from sim_action.drives.wheels import wheel
from sim_action.ros.robot_topics import diagonal, in_frame_of
from sim_action.ros.ros1.node.control import BadController, Controller, ControllerSetup, Parameters
from sim_action.ros.ros1.node.plugins import TICKS, Device
from sim_action.ros.ros1.node.topics import OdometryPublisher, Subscription
from sim_action.ros.ros1.ros_control import INTERFACES
from sim_action.state.command import JointTargets
from sim_action.state.observation import Observation

_TIMEOUT_S: Final = 0.5


@dataclass(frozen=True, slots=True)
class Limit:
    """Limits of a speed in m/s or rad/s, and of its change per second, each as (lowest, highest)."""

    speed: tuple[float, float]
    change: tuple[float, float]

    @classmethod
    def of(cls, parameters: Parameters, name: str) -> Limit:
        """Return the limits in parameters below a name; each applies only if `has_..._limits` is set."""
        return cls(_range(parameters, name, "velocity"), _range(parameters, name, "acceleration"))

    def next(self, command: float, value: float) -> float:
        """Return the speed after one tick."""
        (least, most), (slower, faster) = self.speed, self.change
        aim = max(least, min(most, command))
        return value + max(slower / TICKS, min(faster / TICKS, aim - value))


def _range(parameters: Parameters, name: str, kind: str) -> tuple[float, float]:
    if not parameters.get(f"{name}/has_{kind}_limits", default=False):
        return -math.inf, math.inf
    most = parameters.number(f"{name}/max_{kind}")
    return parameters.number(f"{name}/min_{kind}", -most), most


def open_diff_drive(setup: ControllerSetup) -> Controller:
    """Open diff_drive_controller/DiffDriveController. Odometry is the true motion since the controller started."""
    left, right = setup.fitting("left_wheel", "velocity"), setup.fitting("right_wheel", "velocity")
    subscription = setup.wiring.subscribe(setup.topic("cmd_vel"), Twist, lambda cmd: (cmd.linear.x, cmd.angular.z))
    drive = DiffDriveWheels(setup, left, right, subscription)
    return Controller(
        INTERFACES["velocity"], (*left, *right), drive, _odometry(setup, drive), (subscription,), drive.begin
    )


class DiffDriveWheels:
    """The mover of a diff drive, with limits; `start`: pose of the robot when the controller started; None: not yet."""

    def __init__(
        self, setup: ControllerSetup, left: tuple[str, ...], right: tuple[str, ...], subscription: Subscription
    ) -> None:
        """Read the parameters. Raises BadController."""
        parameters = setup.parameters
        self.start: Pose | None = None
        self._subscription, self._left, self._right = subscription, left, right
        self._timeout = parameters.number("cmd_vel_timeout", _TIMEOUT_S)
        self._forward, self._turning = Limit.of(parameters, "linear/x"), Limit.of(parameters, "angular/z")
        self._half_separation, self._left_radius, self._right_radius = _measures(setup, left[0], right[0])
        self._count, self._since = 0, 0.0
        self._speed = self._turn = 0.0

    def begin(self) -> None:
        """Stand still until the next command."""
        self._subscription.forget()
        self.start = None
        self._speed = self._turn = 0.0

    def __call__(self, seconds: float, seen: Observation) -> JointTargets:
        """Return the wheel speeds of a moment."""
        if self.start is None:
            self.start = seen.pose
        if self._subscription.count != self._count:
            self._count, self._since = self._subscription.count, seconds
        speed, turn = self._subscription.value or (0.0, 0.0)
        if seconds - self._since > self._timeout:
            speed = turn = 0.0
        self._speed, self._turn = self._forward.next(speed, self._speed), self._turning.next(turn, self._turn)
        rim = self._turn * self._half_separation
        return JointTargets(
            velocity={
                **dict.fromkeys(self._left, (self._speed - rim) / self._left_radius),
                **dict.fromkeys(self._right, (self._speed + rim) / self._right_radius),
            }
        )


def _measures(setup: ControllerSetup, left: str, right: str) -> tuple[float, float, float]:
    """Return half the wheel separation and both radii in m, by parameters, else by the model. Raises BadController."""
    parameters, model = setup.parameters, setup.wiring.model
    first, second = wheel(model, left), wheel(model, right)
    separation = parameters.number("wheel_separation", math.dist(first.position_xyz, second.position_xyz))
    radii = [parameters.get("wheel_radius", default=drive_wheel.radius) for drive_wheel in (first, second)]
    if not separation or not all(radii):
        raise BadController(
            f"{parameters.space} needs wheel_separation and wheel_radius: the model does not define them"
        )
    factor = parameters.number("wheel_separation_multiplier", 1.0)
    sides = ("left_wheel_radius_multiplier", "right_wheel_radius_multiplier")
    common = parameters.number("wheel_radius_multiplier", 1.0)
    left_radius, right_radius = (
        float(value) * parameters.number(name, common) for value, name in zip(radii, sides, strict=True)
    )
    return separation * factor / 2, left_radius, right_radius


def _odometry(setup: ControllerSetup, drive: DiffDriveWheels) -> Device:
    parameters, wiring = setup.parameters, setup.wiring
    frame = str(parameters.get("odom_frame_id", default="odom"))
    base = str(parameters.get("base_frame_id", default="base_link"))
    stated = (parameters.get(f"{name}_covariance_diagonal", default=(0.0,) * 6) for name in ("pose", "twist"))
    odometry = OdometryPublisher(
        setup.topic("odom"),
        (frame, base),
        wiring.traffic,
        covariances=tuple(map(diagonal, stated)),
        publishes_tf=bool(parameters.get("enable_odom_tf", default=True)),
    )

    def publish(seconds: float, seen: Observation) -> None:
        pose = geometry.compose(geometry.inverse(drive.start or seen.pose), seen.pose)
        odometry.send(seconds, pose, in_frame_of(seen.pose, seen.twist))

    schedule = wiring.controller_schedule(parameters.space, parameters.number("publish_rate", 50.0))
    return Device(schedule, odometry.publishers, publish)
