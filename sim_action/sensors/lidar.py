"""A lidar that sweeps one plane: `lidar: {rays: 360, range: 3.5 m}`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, ClassVar, Final

from pydantic import Field

from sim_action.core.field_types import NonNegativeMetres, PositiveMetres, PositiveRadians, Radians
from sim_action.core.geometry import compose, rotate
from sim_action.core.units import display
from sim_action.core.yaml_errors import SpecProblems
from sim_action.sensors import Measure, Mount, Sensor, Sight
from sim_action.state.readings import LidarScan
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    import numpy as np
    from numpy.random import Generator
    from numpy.typing import NDArray

_FULL_CIRCLE: Final = 2 * math.pi
_ROUNDING: Final = 1e-9


class Lidar(Sensor):
    """Measures how far it is to what surrounds the robot, in a plane around the sensor.

    The plane is that of the sensor's x and y axes; turn it with `pose`. Rays begin at the sensor and go
    counter-clockwise about its z axis, with the x axis amid the field of view: the scan of 360 rays has what is
    straight ahead at number 180, or at number 0 with `angle_min: 0`. They meet the bodies of the world and the ground,
    never the robot itself.

    A reading is a scan as in ROS (sensor_msgs/LaserScan): `angle_min`, `angle_increment`, `range_min`, `range_max`, and
    `ranges`, an array in m. As REP 117 has it, inf says that nothing is in range, -inf that something is nearer than
    `min_range`; a controller in another process gets null for the first, and 0 for the second.
    `scan.nearest(start_angle, end_angle)` is the shortest range from one angle counter-clockwise to another (so that
    `nearest(1, 0.5)` looks round the back); if both lie between two rays, the nearer ray counts. What the sensor itself
    is inside of, it does not see.
    """

    key: ClassVar[str] = "lidar"

    rays: Annotated[int, Field(ge=1, le=100_000, description="in a scan; one alone looks ahead")] = 360
    field_of_view: Annotated[
        PositiveRadians,
        Field(description="between the first and the last ray; of 360 deg, the last is not the first again"),
    ] = _FULL_CIRCLE
    angle_min: Annotated[
        Radians | None,
        Field(description="of the first ray, from the x axis; left out: half the field of view to the right"),
    ] = None
    min_range: Annotated[NonNegativeMetres, Field(description="what is nearer is seen, but not measured")] = 0.0
    range: Annotated[PositiveMetres, Field(le=1000, description="what is further away is not seen")] = 10.0
    noise: Annotated[
        NonNegativeMetres,
        Field(description="standard deviation of what is measured; Gaussian, from the scenario's seed"),
    ] = 0.0

    @property
    def reading_bytes(self) -> int:
        """See Sensor.reading_bytes."""
        return 8 * self.rays

    def problems(self, scene: Scene) -> SpecProblems:
        """See Sensor.problems."""
        if self.field_of_view > _FULL_CIRCLE + _ROUNDING:
            yield ("field_of_view",), f"expected at most 360 deg, found {display(self.field_of_view, 'rad')}"
        if self.min_range >= self.range:
            yield (("min_range",), f"expected less than 'range', {self.range:g} m, found {self.min_range:g} m")

    def open(self, mount: Mount) -> Measure:
        """See Sensor.open."""
        import numpy as np

        first, increment = self.first_angle, self.increment
        angles = first + increment * np.arange(self.rays)
        cosines, sines = np.cos(angles), np.sin(angles)

        def measure(sight: Sight) -> LidarScan:
            pose = compose(sight.probe.link_pose(mount.link), mount.pose)
            x_axis = rotate(pose.orientation_xyzw, (self.range, 0.0, 0.0))
            y_axis = rotate(pose.orientation_xyzw, (0.0, self.range, 0.0))
            ends = np.empty((self.rays, 3))
            # Sums of products, not a product of matrices, which rounds as the kind of processor has it.
            for column, (x, y, start) in enumerate(zip(x_axis, y_axis, pose.position_xyz, strict=True)):
                ends[:, column] = cosines * x + sines * y + start
            ranges = self._told(self.range * sight.probe.cast_rays(pose.position_xyz, ends), mount.random)
            ranges.flags.writeable = False
            return LidarScan(sight.time, first, increment, self.min_range, self.range, ranges)

        return measure

    @property
    def increment(self) -> float:
        """Rad from one ray to the next."""
        is_circle = self.field_of_view >= _FULL_CIRCLE - _ROUNDING
        return self.field_of_view / max(1, self.rays if is_circle else self.rays - 1)

    @property
    def first_angle(self) -> float:
        """Rad, of the first ray from the x axis."""
        if self.angle_min is not None:
            return self.angle_min
        return -self.field_of_view / 2 if self.rays > 1 else 0.0

    def _told(self, ranges: NDArray[np.float64], random: Generator) -> NDArray[np.float64]:
        """What the sensor makes of true ranges: noise leads neither out of what can be measured, nor into it."""
        near, far = ranges < self.min_range, ranges > self.range
        if self.noise:
            noise = random.normal(0.0, self.noise, self.rays)
            ranges = (ranges + noise).clip(self.min_range, self.range)
        ranges[near], ranges[far] = -math.inf, math.inf
        return ranges
