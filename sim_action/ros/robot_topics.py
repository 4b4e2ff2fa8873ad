"""The topics of a robot: their names, the ticks at which they are published, and values that messages share.

A scenario states names by their keys; the others are the usual ones. The rate of a topic holds on average, also if it
does not divide the rate of the ticks.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Final, Self

from sim_action.core import geometry
from sim_action.core.records import dataclass
from sim_action.core.wording import did_you_mean
from sim_action.core.yaml_document import SpecProblems
from sim_action.robot.model.kinematics import joint_motion
from sim_action.robot.model.robot_model import Joint, RobotModel
from sim_action.world.scene import Fitting

COMMANDS: Final = "cmd_vel"
JOINTS: Final = "joint_states"
ODOMETRY: Final = "odom"

ROBOT_TOPICS: Final[Mapping[str, str]] = MappingProxyType(
    {COMMANDS: "/cmd_vel", JOINTS: "/joint_states", ODOMETRY: "/odom"}
)
"""The usual topics of a robot with a drive, without its sensors."""

_SENSOR_TOPICS: Final = {
    "lidar": "scan",
    "imu": "imu",
    "odometry": ODOMETRY,
    "camera": "image_raw",
    "contact": "contact",
}

_EPSILON = 1e-9
_BILLION: Final = 1_000_000_000


def topics_of(
    sensors: Sequence[Fitting], stated: Mapping[str, str], robot: Mapping[str, str] = ROBOT_TOPICS
) -> dict[str, str]:
    """Return the topics of a robot by the keys of `robot` (`odom` if not measured) and the names of sensors."""
    measured = any(sensor.kind == "odometry" for sensor in sensors)
    topics = {name: topic for name, topic in robot.items() if name != ODOMETRY or not measured}
    topics |= {sensor.name: _topic(sensor, sensors) for sensor in sensors if sensor.kind in _SENSOR_TOPICS}
    return {name: f"/{stated.get(name, topic).lstrip('/')}" for name, topic in topics.items()}


def topic_problems(stated: Mapping[str, str], topics: Mapping[str, str]) -> SpecProblems:
    """Yield problems of stated topics, by their keys: names that the robot lacks, and topics that are used twice."""
    for name in stated:
        if name not in topics:
            yield (name,), f"the robot has no '{name}'{did_you_mean(name, topics)}"
    for name in stated:
        if others := [other for other, topic in topics.items() if other != name and topic == topics.get(name)]:
            yield (name,), f"'{topics[name]}' is already the topic of '{others[0]}'"


def plain_name(name: str) -> str:
    """Return the name of a sensor as a name of ROS: letters, digits and underscores, beginning with a letter."""
    plain = re.sub(r"\W", "_", name, flags=re.ASCII)
    return plain if plain[:1].isalpha() else f"sensor_{plain}"


def _topic(sensor: Fitting, sensors: Sequence[Fitting]) -> str:
    kind = _SENSOR_TOPICS[sensor.kind]
    is_alone = sum(other.kind == sensor.kind for other in sensors) == 1
    return f"/{kind}" if is_alone and sensor.kind != "camera" else f"/{plain_name(sensor.name)}/{kind}"


@dataclass(frozen=True, slots=True)
class Schedule:
    """The ticks at which something is due: `rate` times per second, at most `ticks`, the ticks per second."""

    rate: float
    ticks: float

    @classmethod
    def of(cls, rate: float, ticks: float) -> Self:
        """Return the schedule of a rate; 0, or more than there are ticks, means every tick."""
        return cls(rate if 0 < rate < ticks else ticks, ticks)

    def is_due(self, tick: int) -> bool:
        """Return True if it is due at a tick, counted from 0."""
        return tick == 0 or self._count(tick) != self._count(tick - 1)

    @property
    def is_even(self) -> bool:
        """True if all intervals are equal."""
        interval = self.ticks / self.rate
        return abs(interval - round(interval)) < _EPSILON

    def _count(self, tick: int) -> int:
        return math.floor(tick * self.rate / self.ticks + _EPSILON)


def seconds_and_nanoseconds(time: float) -> tuple[int, int]:
    """Return a sim time in s as whole seconds and the rest in ns, rounded to 1 ns: 0.57 s is not 0.569999999."""
    return divmod(round(time * _BILLION), _BILLION)


PlacedFrame = tuple[str, str, geometry.Pose]  # parent frame, child frame, and the pose of the child in the parent


@dataclass(frozen=True, slots=True)
class LinkFrames:
    """The frames of links, as robot_state_publisher has them; `moving`: parent, child, and the joints in series."""

    fixed: tuple[PlacedFrame, ...]
    moving: tuple[tuple[str, str, tuple[Joint, ...]], ...]

    @classmethod
    def of(cls, model: RobotModel, prefix: str = "") -> Self:
        """Return the frames of a model; `prefix`: of their names."""
        named = ((prefix + child, joints) for child, joints in model.joints_to.items())
        series = [(prefix + joints[0].parent, child, joints) for child, joints in named]
        moving = {child for _, child, joints in series if any(joint.moves for joint in joints)}
        return cls(
            tuple((parent, child, joints[0].origin) for parent, child, joints in series if child not in moving),
            tuple(edge for edge in series if edge[1] in moving),
        )

    def at(self, positions: Mapping[str, float]) -> Iterator[PlacedFrame]:
        """Yield the links that joints move; links with a joint whose position is unknown are left out."""
        for parent, child, series in self.moving:
            pose = series[0].origin
            moving = [joint for joint in series if joint.moves]
            if all(joint.name in positions for joint in moving):
                for joint in moving:
                    pose = geometry.compose(pose, joint_motion(joint, positions[joint.name]))
                yield parent, child, pose


def in_frame_of(pose: geometry.Pose, twist: geometry.Twist) -> geometry.Twist:
    """Return a twist in the world frame, in the frame of a pose (nav_msgs/Odometry's child frame)."""
    back = geometry.conjugate(pose.orientation_xyzw)
    return geometry.Twist(geometry.rotate(back, twist.linear_xyz), geometry.rotate(back, twist.angular_xyz))


def pinhole_of(width: int, height: int, field_of_view: float) -> tuple[float, float, float]:
    """Return the focal length and the centre (x, y) of a camera in pixels.

    The centre of the first pixel is at (0, 0), as in OpenCV and image_geometry, so that the optical axis passes through
    `((width - 1) / 2, (height - 1) / 2)`.
    """
    return width / 2 / math.tan(field_of_view / 2), (width - 1) / 2, (height - 1) / 2


def diagonal(variances: Sequence[float]) -> tuple[float, ...]:
    """Return a square covariance matrix, row by row, with these variances on its diagonal."""
    size = len(variances)
    return tuple(float(variances[row]) if row == column else 0.0 for row in range(size) for column in range(size))
