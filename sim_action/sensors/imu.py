"""The inertial measurement unit: `imu: {gyro_noise: 0.01 rad/s}`."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field
from typing_extensions import override

from sim_action.core import geometry
from sim_action.core.field_types import NonNegativeMetresPerSecondSquared, NonNegativeRadiansPerSecond
from sim_action.core.geometry import Pose, Quaternion, Vector3
from sim_action.core.lazy_numpy import Generator
from sim_action.sensors import Measure, Mount, Sensor, Sight
from sim_action.state.readings import ImuReading


class Imu(Sensor):
    """Measures orientation, angular velocity and linear acceleration: gyroscope and accelerometer.

    A reading has `orientation_xyzw` (in the world, without noise), `angular_velocity_xyz` (rad/s) and
    `linear_acceleration_xyz` (m/s^2), the last two in the sensor's frame. The acceleration includes gravity: at rest it
    is 9.80665 upwards, or the opposite of `world.gravity`. It is the mean since the previous reading.

    The noise is one number for each axis of each reading, and one offset (bias) for each axis of a run. To use the
    noise density of a data sheet, multiply it by the square root of `rate`.
    """

    key: ClassVar[str] = "imu"
    noises = ("gyro_noise", "gyro_bias", "accelerometer_noise", "accelerometer_bias")

    gyro_noise: Annotated[NonNegativeRadiansPerSecond, Field(description="standard deviation of a reading")] = 0.0
    gyro_bias: Annotated[NonNegativeRadiansPerSecond, Field(description="standard deviation of the offset")] = 0.0
    accelerometer_noise: Annotated[
        NonNegativeMetresPerSecondSquared, Field(description="standard deviation of a reading")
    ] = 0.0
    accelerometer_bias: Annotated[
        NonNegativeMetresPerSecondSquared, Field(description="standard deviation of the offset")
    ] = 0.0

    @override
    def open(self, mount: Mount) -> Measure:
        gyro_offset = _scatter(mount.random, geometry.ZERO, self.gyro_bias)
        accelerometer_offset = _scatter(mount.random, geometry.ZERO, self.accelerometer_bias)
        before: _State | None = None

        def measure(sight: Sight) -> ImuReading:
            nonlocal before
            now = _State(mount, sight)
            turning = now.turning()
            felt = now.specific_force(before or now, mount.scene.world.gravity_xyz)
            before = now
            return ImuReading(
                sight.time,
                now.pose.orientation_xyzw,
                _scatter(mount.random, geometry.add(turning, gyro_offset), self.gyro_noise),
                _scatter(mount.random, geometry.add(felt, accelerometer_offset), self.accelerometer_noise),
            )

        return measure


class _State:
    """Pose and velocity of the sensor at a moment, world frame."""

    def __init__(self, mount: Mount, sight: Sight) -> None:
        link = sight.probe.link_pose(mount.link)
        twist = sight.probe.link_twist(mount.link)
        arm = geometry.rotate(link.orientation_xyzw, mount.pose.position_xyz)
        self.pose: Pose = geometry.compose(link, mount.pose)
        self.angular_xyz = twist.angular_xyz
        self.linear_xyz = geometry.add(twist.linear_xyz, geometry.cross(twist.angular_xyz, arm))
        self.time = sight.time

    def turning(self) -> Vector3:
        """Return the angular velocity in rad/s, sensor frame."""
        return geometry.rotate(geometry.conjugate(self.pose.orientation_xyzw), self.angular_xyz)

    def specific_force(self, before: _State, gravity_xyz: Vector3) -> Vector3:
        """Return the mean specific force since `before` in m/s^2, sensor frame."""
        period = (self.time - before.time) or 1.0
        changes = zip(self.linear_xyz, before.linear_xyz, gravity_xyz, strict=True)
        ax, ay, az = ((now - then) / period - pull for now, then, pull in changes)
        # The frame turns during the interval; its mean orientation is half-way.
        midway = _midway(before.pose.orientation_xyzw, self.pose.orientation_xyzw)
        return geometry.rotate(geometry.conjugate(midway), (ax, ay, az))


def _midway(first: Quaternion, second: Quaternion) -> Quaternion:
    """Return the rotation half-way between two."""
    sign = 1.0 if sum(one * other for one, other in zip(first, second, strict=True)) >= 0 else -1.0
    x, y, z, w = (one + sign * other for one, other in zip(first, second, strict=True))
    length = (x * x + y * y + z * z + w * w) ** 0.5
    return (x / length, y / length, z / length, w / length)


def _scatter(random: Generator, around: Vector3, deviation: float) -> Vector3:
    dx, dy, dz = (deviation * random.standard_normal(3)).tolist()
    return geometry.add(around, (dx, dy, dz))
