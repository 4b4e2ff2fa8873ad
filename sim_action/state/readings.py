"""The readings of sensors: one frozen type for each kind, and the columns that a trace stores of each kind.

Also the inputs of sensors besides the observed state: queries to the engine, and the motion that wheels give the base
if they do not slip and nothing is measured with an error.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final, Protocol

from sim_action.core import units
from sim_action.core.geometry import Pose, Quaternion, Twist, Vector3, quaternion_from_rpy
from sim_action.core.lazy_numpy import ArrayLike, NDArray, np
from sim_action.core.records import dataclass, replace
from sim_action.core.units import Dimension


@dataclass(frozen=True, slots=True, eq=False)
class ReadingColumn:
    """A column of readings in a trace.

    Attributes:
        dimension: the dimension of its numbers.
        axes: a letter for each number, such as "xyz"; "" for a single one.
        many: True if a reading holds any number of values, such as the ranges of a scan.
        least, most: the values that none of its numbers can exceed.
        norm: the norm of its numbers, if it is always the same.
    """

    dimension: Dimension
    axes: str = ""
    many: bool = False
    least: float = -math.inf
    most: float = math.inf
    norm: float | None = None

    def limits(self, which: str | None) -> tuple[float, float]:
        """Return the least and the greatest possible value of a number, a statistic or the norm (`which`)."""
        if which != "norm":
            return self.least, self.most
        return (0.0, math.inf) if self.norm is None else (self.norm - _ROUNDING, self.norm + _ROUNDING)

    @property
    def may_be_biased(self) -> bool:
        """True if a sensor can add an error to its numbers: not to flags, colours or orientations."""
        return self.norm is None and math.isinf(self.most)

    @property
    def is_single(self) -> bool:
        """True if a reading has one number in this column."""
        return not self.axes and not self.many


_RATIO: Final = units.RATIO
_ROUNDING: Final = 1e-6
_ORIENTATION: Final = ReadingColumn(_RATIO, "xyzw", least=-1.0, most=1.0, norm=1.0)

READING_COLUMNS: Final[Mapping[str, Mapping[str, ReadingColumn]]] = MappingProxyType(
    {
        "camera": {
            "rgb": ReadingColumn(_RATIO, many=True, least=0.0, most=255.0),
            "depth": ReadingColumn(units.LENGTH, many=True, least=0.0),
        },
        "contact": {
            "touching": ReadingColumn(_RATIO, least=0.0, most=1.0),
            "force": ReadingColumn(units.FORCE, least=0.0),
        },
        "imu": {
            "orientation_xyzw": _ORIENTATION,
            "angular_velocity_xyz": ReadingColumn(units.ANGULAR_SPEED, "xyz"),
            "linear_acceleration_xyz": ReadingColumn(units.ACCELERATION, "xyz"),
        },
        "lidar": {"ranges": ReadingColumn(units.LENGTH, many=True, least=0.0)},
        "odometry": {
            "position_xyz": ReadingColumn(units.LENGTH, "xyz"),
            "orientation_xyzw": _ORIENTATION,
            "linear_xyz": ReadingColumn(units.SPEED, "xyz"),
            "angular_xyz": ReadingColumn(units.ANGULAR_SPEED, "xyz"),
        },
    }
)
"""The columns of each kind of sensor of sim-action, by name."""

DISTANCES: Final = frozenset({"ranges", "depth"})  # the columns that are infinite where nothing is in range
_OF_PACKAGES: Final[dict[str, Mapping[str, ReadingColumn]]] = {}


def know_columns(kind: str, columns: Mapping[str, ReadingColumn]) -> None:
    """Take the columns of a kind of sensor that an installed package brings; its class was imported."""
    _OF_PACKAGES[kind] = columns


def columns_of(kind: str) -> Mapping[str, ReadingColumn]:
    """Return the columns of a kind of sensor, by name; none if it is unknown."""
    return READING_COLUMNS.get(kind) or _OF_PACKAGES.get(kind, {})


def biased_columns(kind: str) -> dict[str, ReadingColumn]:
    """Return the columns of a kind of sensor to which a fault can add an error."""
    return {name: column for name, column in columns_of(kind).items() if column.may_be_biased}


_FULL_CIRCLE: Final = 2 * math.pi
_ANGLE_EPSILON: Final = 1e-9  # equal angles may differ by rounding


class Reading(Protocol):
    """The interface of all readings."""

    @property
    def time(self) -> float:
        """The sim time of the measurement in s."""

    def columns(self) -> Mapping[str, ArrayLike]:
        """Return the values that change from one reading to the next, by the names of their columns in a trace."""


@dataclass(frozen=True, slots=True, eq=False)
class Values:
    """The reading of a sensor of an installed package.

    Attributes:
        values: column name -> a number, or an array of numbers that always has the same shape.
    """

    time: float
    values: Mapping[str, Any]

    def columns(self) -> Mapping[str, Any]:
        """Return the stored values; see Reading.columns."""
        return self.values


@dataclass(frozen=True, slots=True)
class ContactReading:
    """The reading of a contact sensor: the contacts of one link.

    Attributes:
        touching: True if the link touches something.
        force: sum of the normal forces in N, at the physics step of the reading.
        bodies: the names of the touched bodies; the ground is "ground".
    """

    time: float
    touching: bool
    force: float
    bodies: tuple[str, ...]

    def columns(self) -> Mapping[str, Any]:
        """Return the stored values; see Reading.columns."""
        return {"touching": float(self.touching), "force": float(self.force)}


@dataclass(frozen=True, slots=True)
class ImuReading:
    """The reading of an IMU: orientation, angular velocity and linear acceleration.

    Attributes:
        orientation_xyzw: the orientation of the sensor in the world.
        angular_velocity_xyz: the angular velocity in rad/s, sensor frame.
        linear_acceleration_xyz: the specific force in m/s^2, sensor frame: at rest it is gravity, upwards.
    """

    time: float
    orientation_xyzw: Quaternion
    angular_velocity_xyz: Vector3
    linear_acceleration_xyz: Vector3

    def columns(self) -> Mapping[str, Any]:
        """Return the stored values; see Reading.columns."""
        return {
            "orientation_xyzw": self.orientation_xyzw,
            "angular_velocity_xyz": self.angular_velocity_xyz,
            "linear_acceleration_xyz": self.linear_acceleration_xyz,
        }


@dataclass(frozen=True, slots=True)
class OdometryReading:
    """The reading of wheel odometry: the pose and the twist of the base, computed from its wheels.

    Attributes:
        pose: the pose of the base link, world frame; at the start it is exact.
        twist: the mean twist of the base link since the last reading, in its own frame.
    """

    time: float
    pose: Pose
    twist: Twist

    def columns(self) -> Mapping[str, Any]:
        """Return the stored values; see Reading.columns."""
        return {
            "position_xyz": self.pose.position_xyz,
            "orientation_xyzw": self.pose.orientation_xyzw,
            "linear_xyz": self.twist.linear_xyz,
            "angular_xyz": self.twist.angular_xyz,
        }


@dataclass(frozen=True, slots=True, eq=False)
class CameraImage:
    """The image of a camera; rows go down, columns to the right. The arrays are read-only.

    Attributes:
        rgb: (H, W, 3) red, green and blue, 0 to 255.
        depth: (H, W) in m along the viewing direction of the camera, not along the ray of the pixel; inf for no hit.
    """

    time: float
    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]

    def columns(self) -> Mapping[str, Any]:
        """Return the stored values; see Reading.columns."""
        return {"rgb": self.rgb, "depth": self.depth}


@dataclass(frozen=True, slots=True, eq=False)
class LidarScan:
    """The scan of a lidar: distances to its surroundings, in the plane of the sensor's x and y axes.

    Attributes:
        angle_min: the angle of the first ray in rad, counter-clockwise about the sensor's z axis from its x axis.
        angle_increment: the angle between two rays in rad.
        range_min, range_max: the limits of measured distances in m.
        ranges: (N,) m; inf: nothing in range; -inf: something nearer than `range_min` (ROS REP 117). Read-only.
    """

    time: float
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    ranges: NDArray[np.float64]

    @property
    def angles(self) -> NDArray[np.float64]:
        """The angles of the rays, (N,) rad."""
        return self.angle_min + self.angle_increment * np.arange(len(self.ranges), dtype=np.float64)

    def nearest(self, start_angle: float, end_angle: float) -> float:
        """Return the shortest range in m between two angles in rad, counter-clockwise; inf if nothing is there.

        `nearest(1.0, 0.5)` covers the back. If no ray lies between the angles, the nearest ray counts; outside
        the field of view the result is inf.
        """
        width = end_angle - start_angle
        if width < 0:
            width %= _FULL_CIRCLE
        past = (self.angles - start_angle + _ANGLE_EPSILON) % _FULL_CIRCLE
        within = past <= width + 2 * _ANGLE_EPSILON
        if not within.any() and width < self.angle_increment:
            # The angle of each ray to the nearer of the two limits.
            beside = np.minimum(past - width, _FULL_CIRCLE - past)
            within = beside <= min(self.angle_increment, beside.min() + 4 * _ANGLE_EPSILON)
        return float(self.ranges[within].min(initial=math.inf))

    def columns(self) -> Mapping[str, Any]:
        """Return the stored values; see Reading.columns."""
        return {"ranges": self.ranges}


def shifted(reading: Reading, kind: str, offsets: Mapping[str, float | tuple[float, ...]]) -> Reading:
    """Return a reading with offsets added, within the limits of its sensor; ranges beyond them are infinite."""
    values = reading.columns()
    columns = columns_of(kind)
    changed: dict[str, Any] = {}
    for name, offset in offsets.items():
        column, was = columns[name], np.asarray(values[name])
        moved = np.clip(was + np.asarray(offset), column.least, column.most)
        if isinstance(reading, LidarScan):
            moved = np.where(moved >= reading.range_max, math.inf, moved)
            moved = np.where(moved <= reading.range_min, -math.inf, moved) if reading.range_min else moved
        number = np.where(np.isfinite(was), moved, was).astype(np.result_type(was.dtype, np.float32))
        number.flags.writeable = False
        changed[name] = number if column.many else number.item() if column.is_single else tuple(number.tolist())
    if isinstance(reading, OdometryReading):
        pose = Pose(changed.get("position_xyz", reading.pose.position_xyz), reading.pose.orientation_xyzw)
        linear = changed.get("linear_xyz", reading.twist.linear_xyz)
        return replace(reading, pose=pose, twist=Twist(linear, changed.get("angular_xyz", reading.twist.angular_xyz)))
    record: Any = reading
    biased: Reading = replace(record, **({"values": {**values, **changed}} if isinstance(reading, Values) else changed))
    return biased


class EngineQueries(Protocol):
    """The queries of sensors to a physics engine; none of them changes the run."""

    def link_pose(self, link: str) -> Pose:
        """Return the pose of a link's frame in the world; the frame is not the centre of mass."""

    def link_twist(self, link: str) -> Twist:
        """Return the twist of the origin of a link's frame, in the world frame."""

    def body_pose(self, body: str) -> Pose:
        """Return the pose of the centre of a body of the world, by name; the ground has none."""

    def cast_rays(self, start_xyz: Vector3, ends_xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        """Cast rays that hit the bodies of the world and the ground, but never the robot.

        A body around `start_xyz` is not hit: rays see surfaces from outside only.

        Returns:
            (N,) the fraction of each ray, 0 to 1, at which it hits a surface; inf: no hit.

        `start_xyz`: the start of all rays, in m, world frame; `ends_xyz`: (N, 3) the ends of the rays, in m, world
        frame.
        """


@dataclass(frozen=True, slots=True)
class PlanarWay:
    """A motion of a point of the base along an arc on the ground, in the axes of the turning base."""

    x: float  # x, y: the distance in m along the axes of the base, summed along the arc
    y: float
    turn: float  # the turn to the left in rad

    def of_point(self, x: float, y: float) -> PlanarWay:
        """Return the motion of the point of the base that is at (x, y) m from this one."""
        return PlanarWay(self.x - self.turn * y, self.y + self.turn * x, self.turn)

    def pose(self) -> Pose:
        """Return the end pose, seen from the start pose. Exact: the chord of an arc points in its mean direction."""
        # The watchdog reports a state that is not finite.
        turn = self.turn if math.isfinite(self.turn) else math.nan
        half = turn / 2
        chord = math.sin(half) / half if half else 1.0
        cosine, sine = chord * math.cos(half), chord * math.sin(half)
        position = (cosine * self.x - sine * self.y, sine * self.x + cosine * self.y, 0.0)
        return Pose(position, quaternion_from_rpy(0.0, 0.0, turn))

    def twist(self, duration: float) -> Twist:
        """Return the velocity that makes this motion in `duration` s, in the frame of the base."""
        return Twist((self.x / duration, self.y / duration, 0.0), (0.0, 0.0, self.turn / duration))


class WheelMotion(Protocol):
    """The relation between the wheels of a robot and the motion of its base."""

    @property
    def gears(self) -> Mapping[str, float]:
        """The rolling distance in m for 1 rad of each wheel joint."""

    @property
    def steering(self) -> tuple[str, ...]:
        """The joints that steer."""

    @property
    def middle_xy(self) -> tuple[float, float]:
        """The reference point of the motion in m, base frame: the centre of a turn on the spot."""

    def way(self, rolled: Mapping[str, float], steered: Mapping[str, float]) -> PlanarWay:
        """Return the motion of the reference point."""
