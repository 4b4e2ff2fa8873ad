"""Wheel odometry: `odometry`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, ClassVar

from pydantic import Field

from sim_action.core import geometry
from sim_action.core.field_types import NonNegativeMetres, Ratio
from sim_action.core.geometry import Pose
from sim_action.sensors import Measure, Mount, Sensor, Sight
from sim_action.state.readings import OdometryReading
from sim_action.state.sensor_inputs import PlanarWay, WheelMotion

if TYPE_CHECKING:
    from sim_action.state.observation import Observation

# Wheels measure nothing if they are taken for none, and the way backward if for less.
ErrorRatio = Annotated[Ratio, Field(gt=-1, le=100)]


class Odometry(Sensor):
    """Tells where the robot believes it is: what the joints of its wheels and of its steering say of its way.

    A reading has `pose` and `twist`, both of the base link. The pose is in the world frame: the first one is where the
    robot really begins, and what follows is added up from there, over level ground, by the kinematics of the robot's
    drive. The twist (m/s and rad/s) is the mean since the reading before, in the frame of the base, as in
    nav_msgs/Odometry. It drifts as real odometry does: wheels that slip go unnoticed, such as those of a car that
    spins them, or of skid steer, which turns by slipping; and by what is said here. Errors are ratios: 0.01 means that
    the robot believes 1 % more than there is.
    """

    key: ClassVar[str] = "odometry"
    reads_wheels: ClassVar[bool] = True

    noise: Annotated[
        NonNegativeMetres,
        Field(le=1000, description="standard deviation of a wheel's way after 1 m; it grows with the root of the way"),
    ] = 0.0
    resolution: Annotated[
        int | None,
        Field(gt=0, le=1_000_000_000, description="ticks of a wheel's encoder in a turn; left out: it is exact"),
    ] = None
    radius_error: Annotated[ErrorRatio, Field(description="of the radius of the wheels")] = 0.0
    separation_error: Annotated[
        ErrorRatio, Field(description="of the distance of the wheels; with steered wheels, of the wheelbase")
    ] = 0.0

    def open(self, mount: Mount) -> Measure:
        """See Sensor.open."""
        assert mount.wheels is not None, "the loader refuses odometry without a drive"
        return _OdometryReader(self, mount, mount.wheels)


class _OdometryReader:
    """The live half: believes, and adds up."""

    def __init__(self, spec: Odometry, mount: Mount, wheels: WheelMotion) -> None:
        self._spec, self._wheels = spec, wheels
        self._random, self._period = mount.random, 1 / mount.rate
        self._joints: Mapping[str, float] = {}
        self._level, self._tilt = Pose(), geometry.IDENTITY

    def __call__(self, sight: Sight) -> OdometryReading:
        if not self._joints:
            self._begin(sight.robot)
        before, self._joints = self._joints, self._measured(sight.robot)
        way = self._way(before or self._joints, self._joints)
        self._level = geometry.compose(self._level, way.pose())
        pose = geometry.compose(self._level, Pose(orientation_xyzw=self._tilt))
        return OdometryReading(sight.time, pose, way.twist(self._period))

    def _begin(self, robot: Observation) -> None:
        """The ground is level, also where the robot is not."""
        heading = geometry.quaternion_from_rpy(0.0, 0.0, robot.pose.yaw)
        self._level = Pose(robot.pose.position_xyz, heading)
        self._tilt = geometry.multiply(geometry.conjugate(heading), robot.pose.orientation_xyzw)

    def _measured(self, robot: Observation) -> dict[str, float]:
        """Joint -> rad: of wheels as their encoders have it."""
        steered = {name: robot.joints[name].position for name in self._wheels.steering}
        return steered | {name: self._ticked(robot.joints[name].position) for name in self._wheels.gears}

    def _ticked(self, angle: float) -> float:
        # Of a state that is not finite there is no whole number; the watchdog tells of it.
        if self._spec.resolution is None or not math.isfinite(angle):
            return angle
        tick = math.tau / self._spec.resolution
        return math.floor(angle / tick) * tick

    def _way(self, before: Mapping[str, float], now: Mapping[str, float]) -> PlanarWay:
        """Of the base, in the frame that it had before."""
        rolled = {name: self._rolled(gear * (now[name] - before[name])) for name, gear in self._wheels.gears.items()}
        # What steers moves on its way from one reading to the next.
        steered = {name: (before[name] + now[name]) / 2 for name in self._wheels.steering}
        way = self._wheels.way(rolled, steered)
        x, y = self._wheels.middle_xy
        return PlanarWay(way.x, way.y, way.turn / (1 + self._spec.separation_error)).of_point(-x, -y)

    def _rolled(self, way: float) -> float:
        """What is believed of the way of a wheel, in m."""
        deviation = self._spec.noise * math.sqrt(abs(way))
        return way * (1 + self._spec.radius_error) + deviation * float(self._random.standard_normal())
