"""The readings of sensors: one frozen type for each kind, and the columns that a trace stores of each kind."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, Protocol

from sim_action.core import units
from sim_action.core.geometry import Pose, Quaternion, Twist, Vector3
from sim_action.core.units import Dimension

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, slots=True, eq=False)
class ReadingColumn:
    """One column.

    Attributes:
        dimension: of its numbers.
        axes: a letter for each number, such as "xyz"; "" for a single one.
        many: whether it holds any number of numbers instead, such as the ranges of a scan.
    """

    dimension: Dimension
    axes: str = ""
    many: bool = False

    @property
    def is_single(self) -> bool:
        """Whether it is one number."""
        return not self.axes and not self.many


_RATIO: Final = units.RATIO

READING_COLUMNS: Final[Mapping[str, Mapping[str, ReadingColumn]]] = MappingProxyType(
    {
        "camera": {
            "rgb": ReadingColumn(_RATIO, many=True),
            "depth": ReadingColumn(units.LENGTH, many=True),
        },
        "contact": {
            "touching": ReadingColumn(_RATIO),
            "force": ReadingColumn(units.FORCE),
        },
        "imu": {
            "orientation_xyzw": ReadingColumn(_RATIO, "xyzw"),
            "angular_velocity_xyz": ReadingColumn(units.ANGULAR_SPEED, "xyz"),
            "linear_acceleration_xyz": ReadingColumn(units.ACCELERATION, "xyz"),
        },
        "lidar": {
            "ranges": ReadingColumn(units.LENGTH, many=True),
        },
        "odometry": {
            "position_xyz": ReadingColumn(units.LENGTH, "xyz"),
            "orientation_xyzw": ReadingColumn(_RATIO, "xyzw"),
            "linear_xyz": ReadingColumn(units.SPEED, "xyz"),
            "angular_xyz": ReadingColumn(units.ANGULAR_SPEED, "xyz"),
        },
    }
)
"""Kind of sensor -> its columns by name."""


_FULL_CIRCLE: Final = 2 * math.pi
# Angles that are meant to be the same differ by rounding.
_ANGLE_EPSILON: Final = 1e-9


class Reading(Protocol):
    """What all readings are."""

    @property
    def time(self) -> float:
        """Sim time in s at which it was measured."""

    def columns(self) -> Mapping[str, ArrayLike]:
        """What changes from one reading to the next, under the names that a stored trace has it by."""


@dataclass(frozen=True, slots=True)
class ContactReading:
    """Whether a link touches something.

    Attributes:
        touching: whether it does.
        force: sum of the normal forces in N.
        bodies: names of what it touches; the ground is "ground".
    """

    time: float
    touching: bool
    force: float
    bodies: tuple[str, ...]

    def columns(self) -> Mapping[str, Any]:
        """See Reading.columns."""
        return {"touching": float(self.touching), "force": float(self.force)}


@dataclass(frozen=True, slots=True)
class ImuReading:
    """How a sensor turns and accelerates, and how it is turned.

    Attributes:
        orientation_xyzw: of the sensor in the world.
        angular_velocity_xyz: rad/s, sensor frame.
        linear_acceleration_xyz: m/s^2, sensor frame, the specific force: at rest, gravity upwards.
    """

    time: float
    orientation_xyzw: Quaternion
    angular_velocity_xyz: Vector3
    linear_acceleration_xyz: Vector3

    def columns(self) -> Mapping[str, Any]:
        """See Reading.columns."""
        return {
            "orientation_xyzw": self.orientation_xyzw,
            "angular_velocity_xyz": self.angular_velocity_xyz,
            "linear_acceleration_xyz": self.linear_acceleration_xyz,
        }


@dataclass(frozen=True, slots=True)
class OdometryReading:
    """Where a robot believes it is by its wheels.

    Attributes:
        pose: of the base link, world frame; where it begins, that is the truth.
        twist: of the base link, in its own frame, in the mean since the reading before.
    """

    time: float
    pose: Pose
    twist: Twist

    def columns(self) -> Mapping[str, Any]:
        """See Reading.columns."""
        return {
            "position_xyz": self.pose.position_xyz,
            "orientation_xyzw": self.pose.orientation_xyzw,
            "linear_xyz": self.twist.linear_xyz,
            "angular_xyz": self.twist.angular_xyz,
        }


@dataclass(frozen=True, slots=True, eq=False)
class CameraImage:
    """What a camera sees; rows go down, columns to the right. The arrays cannot be written to.

    Attributes:
        rgb: (H, W, 3) red, green and blue, 0 to 255.
        depth: (H, W) in m along the way that the camera looks, not along the ray of the pixel; inf where nothing is.
    """

    time: float
    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]

    def columns(self) -> Mapping[str, Any]:
        """See Reading.columns."""
        return {"rgb": self.rgb, "depth": self.depth}


@dataclass(frozen=True, slots=True, eq=False)
class LidarScan:
    """How far it is to what surrounds a sensor, in the plane of its x and y axes.

    Attributes:
        angle_min: of the first ray in rad, counter-clockwise about the sensor's z axis from its x axis.
        angle_increment: rad from one ray to the next.
        range_min, range_max: m, between which distances are measured.
        ranges: (N,) m; inf: nothing is in range; -inf: something is nearer than `range_min` (ROS REP 117). Read only.
    """

    time: float
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    ranges: NDArray[np.float64]

    @property
    def angles(self) -> NDArray[np.float64]:
        """(N,) rad, of each ray."""
        import numpy as np

        return self.angle_min + self.angle_increment * np.arange(len(self.ranges), dtype=np.float64)

    def nearest(self, start_angle: float, end_angle: float) -> float:
        """The shortest range in m from one angle counter-clockwise to the other, in rad; inf: nothing is there.

        `nearest(1.0, 0.5)` looks round the back. Between rays, the nearest ray counts; where the sensor does not look
        at all, the answer is inf.
        """
        import numpy as np

        width = end_angle - start_angle
        if width < 0:
            width %= _FULL_CIRCLE
        past = (self.angles - start_angle + _ANGLE_EPSILON) % _FULL_CIRCLE
        within = past <= width + 2 * _ANGLE_EPSILON
        if not within.any() and width < self.angle_increment:
            # How far each ray is before the one angle or past the other.
            beside = np.minimum(past - width, _FULL_CIRCLE - past)
            within = beside <= min(self.angle_increment, beside.min() + 4 * _ANGLE_EPSILON)
        return float(self.ranges[within].min(initial=math.inf))

    def columns(self) -> Mapping[str, Any]:
        """See Reading.columns."""
        return {"ranges": self.ranges}
