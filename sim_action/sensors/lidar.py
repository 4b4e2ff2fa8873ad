"""The lidar, which scans one plane: `lidar: {rays: 360, range: 3.5 m}`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Final

from pydantic import Field
from typing_extensions import override

from sim_action.core.field_types import NonNegativeMetres, PositiveMetres, PositiveRadians, Radians
from sim_action.core.geometry import compose, rotate
from sim_action.core.lazy_numpy import Generator, NDArray, np
from sim_action.core.units import display
from sim_action.core.yaml_document import SpecProblems
from sim_action.sensors import Measure, Mount, Sensor, Sight
from sim_action.state.readings import LidarScan
from sim_action.world.scene import Scene

_FULL_CIRCLE: Final = 2 * math.pi
_ROUNDING: Final = 1e-9


class Lidar(Sensor):
    """Measures the distances to surrounding surfaces in one plane.

    The plane contains the sensor's x and y axes. Rays are numbered counter-clockwise, with the x axis in the centre
    of the field of view: of 360 rays, number 180 points ahead; with `angle_min: 0` it is number 0. Rays meet bodies of
    the world and the ground, never the robot or a body that contains the sensor.

    A reading is a scan as in ROS (sensor_msgs/LaserScan): `angle_min`, `angle_increment`, `range_min`, `range_max`, and
    `ranges`, an array in m. As in REP 117, inf means that nothing is in range, and -inf that a surface is nearer than
    `min_range`, also because of the noise. `scan.nearest(start_angle, end_angle)` returns the shortest range from one
    angle counter-clockwise to another; `nearest(1, 0.5)` includes the rear.
    """

    key: ClassVar[str] = "lidar"
    range_keys: ClassVar[Mapping[str, str]] = {"ranges": "range"}
    noises = ("noise",)

    rays: Annotated[int, Field(ge=1, le=100_000, description="rays per scan; a single ray points ahead")] = 360
    field_of_view: Annotated[
        PositiveRadians,
        Field(description="angle from the first ray to the last; at 360 deg the last ray does not repeat the first"),
    ] = _FULL_CIRCLE
    angle_min: Annotated[
        Radians | None,
        Field(description="angle of the first ray from the x axis; default: minus half the field of view"),
    ] = None
    min_range: Annotated[NonNegativeMetres, Field(description="nearer surfaces are detected, but not measured")] = 0.0
    range: Annotated[PositiveMetres, Field(le=1000, description="farther surfaces are not seen")] = 10.0
    noise: Annotated[
        NonNegativeMetres, Field(description="standard deviation of the ranges; Gaussian, from the scenario's seed")
    ] = 0.0

    @override
    def limits(self, reading: str, which: str | None) -> tuple[float, float]:
        least, most = super().limits(reading, which)
        # A surface nearer than `min_range`, perhaps only with its noise, is -inf.
        return (-math.inf if self.min_range or self.noise else least), most

    @property
    @override
    def reading_bytes(self) -> int:
        return 8 * self.rays

    @override
    def problems(self, scene: Scene) -> SpecProblems:
        if self.field_of_view > _FULL_CIRCLE + _ROUNDING:
            yield ("field_of_view",), f"expected at most 360 deg, found {display(self.field_of_view, 'rad')}"
        if self.min_range >= self.range:
            yield (("min_range",), f"expected less than 'range', {self.range:g} m, found {self.min_range:g} m")

    @override
    def open(self, mount: Mount) -> Measure:
        first, increment = self.first_angle, self.increment
        angles = first + increment * np.arange(self.rays)
        cosines, sines = np.cos(angles), np.sin(angles)

        def measure(sight: Sight) -> LidarScan:
            pose = compose(sight.probe.link_pose(mount.link), mount.pose)
            x_axis = rotate(pose.orientation_xyzw, (self.range, 0.0, 0.0))
            y_axis = rotate(pose.orientation_xyzw, (0.0, self.range, 0.0))
            ends = np.empty((self.rays, 3))
            # Sums of products: the rounding of a matrix product depends on the processor.
            for column, (x, y, start) in enumerate(zip(x_axis, y_axis, pose.position_xyz, strict=True)):
                ends[:, column] = cosines * x + sines * y + start
            ranges = self._measured(self.range * sight.probe.cast_rays(pose.position_xyz, ends), mount.random)
            ranges.flags.writeable = False
            return LidarScan(sight.time, first, increment, self.min_range, self.range, ranges)

        return measure

    @property
    def increment(self) -> float:
        """The angle from one ray to the next in rad."""
        is_circle = self.field_of_view >= _FULL_CIRCLE - _ROUNDING
        return self.field_of_view / max(1, self.rays if is_circle else self.rays - 1)

    @property
    def first_angle(self) -> float:
        """The angle of the first ray from the x axis in rad."""
        if self.angle_min is not None:
            return self.angle_min
        return -self.field_of_view / 2 if self.rays > 1 else 0.0

    def _measured(self, ranges: NDArray[np.float64], random: Generator) -> NDArray[np.float64]:
        """Return the measured ranges. A surface out of range stays so; noise may move others out of range."""
        near, far = ranges < self.min_range, ranges > self.range
        if self.noise:
            ranges, seen = ranges + random.normal(0.0, self.noise, self.rays), ~(near | far)
            # Drivers judge the range that they measured. Clipping would pile readings up at the limits.
            near |= seen & (ranges <= self.min_range)
            far |= seen & (ranges >= self.range)
        ranges[near], ranges[far] = -math.inf, math.inf
        return ranges
