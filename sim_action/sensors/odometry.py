"""Wheel odometry: `odometry: {resolution: 4096}`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar

from pydantic import Field
from typing_extensions import override

from sim_action.core import geometry
from sim_action.core.field_types import NonNegativeMetres, Ratio
from sim_action.core.geometry import Pose
from sim_action.sensors import Measure, Mount, Sensor, Sight
from sim_action.state.observation import Observation
from sim_action.state.readings import OdometryReading, PlanarWay, WheelMotion

ErrorRatio = Annotated[Ratio, Field(gt=-1, le=100)]  # at -1 the believed radius is 0; below, it is negative


class Odometry(Sensor):
    """Estimates the robot's pose from the joints of its wheels and of its steering.

    A reading has `pose` (world frame) and `twist` (base frame, mean since the previous reading) of the base link. The
    first pose is the true one; the following ones add up the motion of the wheels by the kinematics of the drive. The
    estimate drifts as real odometry does: slipping wheels go unnoticed. The keys below add errors; 0.01 means that the
    robot assumes 1 % more than the true value.
    """

    key: ClassVar[str] = "odometry"
    noises = ("noise",)
    reads_wheels: ClassVar[bool] = True

    noise: Annotated[
        NonNegativeMetres,
        Field(
            le=1000,
            description="standard deviation of a wheel's distance after 1 m; grows with the root of the distance",
        ),
    ] = 0.0
    resolution: Annotated[
        int | None,
        Field(gt=0, le=1_000_000_000, description="encoder ticks per wheel revolution; default: exact angles"),
    ] = None
    radius_error: Annotated[ErrorRatio, Field(description="error of the wheel radius")] = 0.0
    separation_error: Annotated[
        ErrorRatio, Field(description="error of the wheel separation; with steered wheels, of the wheelbase")
    ] = 0.0

    @override
    def open(self, mount: Mount) -> Measure:
        assert mount.wheels is not None, "the loader refuses odometry without a drive"
        return _OdometryReader(self, mount, mount.wheels)


class _OdometryReader:
    """Adds up the motion of the wheels from reading to reading."""

    def __init__(self, spec: Odometry, mount: Mount, wheels: WheelMotion) -> None:
        self._spec, self._wheels = spec, wheels
        self._random, self._period = mount.random, 1 / mount.rate
        self._joints: Mapping[str, float] = {}
        self._level, self._tilt = Pose(), geometry.IDENTITY

    def __call__(self, sight: Sight) -> OdometryReading:
        if not self._joints:
            heading = geometry.quaternion_from_rpy(0.0, 0.0, sight.robot.pose.yaw)
            self._level = Pose(sight.robot.pose.position_xyz, heading)
            self._tilt = geometry.multiply(geometry.conjugate(heading), sight.robot.pose.orientation_xyzw)
        before, self._joints = self._joints, self._measured(sight.robot)
        way = self._way(before or self._joints, self._joints)
        self._level = geometry.compose(self._level, way.pose())
        pose = geometry.compose(self._level, Pose(orientation_xyzw=self._tilt))
        return OdometryReading(sight.time, pose, way.twist(self._period))

    def _measured(self, robot: Observation) -> dict[str, float]:
        steered = {name: robot.joints[name].position for name in self._wheels.steering}
        return steered | {name: self._ticked(robot.joints[name].position) for name in self._wheels.gears}

    def _ticked(self, angle: float) -> float:
        # A state that is not finite has no tick; the watchdog reports it.
        if self._spec.resolution is None or not math.isfinite(angle):
            return angle
        tick = math.tau / self._spec.resolution
        return math.floor(angle / tick) * tick

    def _way(self, before: Mapping[str, float], now: Mapping[str, float]) -> PlanarWay:
        """Return the motion of the base in its previous frame."""
        rolled = {name: self._rolled(gear * (now[name] - before[name])) for name, gear in self._wheels.gears.items()}
        # Steering joints move between two readings; their mean angle is used.
        steered = {name: (before[name] + now[name]) / 2 for name in self._wheels.steering}
        way = self._wheels.way(rolled, steered)
        x, y = self._wheels.middle_xy
        return PlanarWay(way.x, way.y, way.turn / (1 + self._spec.separation_error)).of_point(-x, -y)

    def _rolled(self, way: float) -> float:
        deviation = self._spec.noise * math.sqrt(abs(way))
        return way * (1 + self._spec.radius_error) + deviation * float(self._random.standard_normal())
