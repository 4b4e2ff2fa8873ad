"""Messages of ROS as commands: their types, and the conversion of each."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple, get_args

from sim_action.commands.logs import KINDS, Content, JointColumn, JointRow, Kind, Steering, Trajectory, TrajectoryPoint
from sim_action.core.geometry import Twist, Vector3
from sim_action.core.records import dataclass

MessageType = Literal[
    "geometry_msgs/msg/Twist",
    "geometry_msgs/msg/TwistStamped",
    "ackermann_msgs/msg/AckermannDrive",
    "ackermann_msgs/msg/AckermannDriveStamped",
    "sensor_msgs/msg/JointState",
    "trajectory_msgs/msg/JointTrajectory",
    "std_msgs/msg/Float64MultiArray",
]

TWISTS: Final = frozenset(name for name in get_args(MessageType) if name.startswith(("geometry", "ackermann")))
"""The message types that command a base."""

Stamps = Literal["receipt", "header", "clock"]
ARRAY: Final = "std_msgs/msg/Float64MultiArray"


@dataclass(frozen=True, slots=True)
class MessageSelection:
    """The messages that a command source replays."""

    topic: str
    type: str | None = None  # the required type of the messages; None: any of `TYPES`
    stamps: Stamps = "receipt"  # the times that count: of receipt, of `header.stamp`, or of /clock in the log
    joints: tuple[str, ...] = ()  # the joints of the numbers of an array
    interface: Kind = "position"  # the quantity of these numbers


class MessageError(ValueError):
    """A message that cannot be converted to a command."""


def _twist(message: Any, _: MessageSelection) -> Twist:
    return Twist(_vector(message.linear, "linear"), _vector(message.angular, "angular"))


def _vector(vector: Any, group: str) -> Vector3:
    return _finite(vector.x, f"{group}.x"), _finite(vector.y, f"{group}.y"), _finite(vector.z, f"{group}.z")


def _finite(number: float, place: str) -> float:
    if not math.isfinite(number):
        raise MessageError(f"{place} is {number}, which is not finite")
    return float(number)


def _steering(message: Any, _: MessageSelection) -> Steering:
    return Steering(_finite(message.speed, "speed"), _finite(message.steering_angle, "steering_angle"))


def _joint_state(message: Any, _: MessageSelection) -> JointRow | None:
    values: dict[JointColumn, float] = {}
    for kind in KINDS:
        values |= _row(list(message.name), kind, getattr(message, kind).tolist())
    return values or None


def _row(names: Sequence[str], kind: Kind, numbers: Sequence[float]) -> JointRow:
    """Return the numbers of joints; NaN means that there is none. Raises MessageError."""
    if len(set(names)) != len(names):
        raise MessageError("it names a joint twice")
    if numbers and len(numbers) != len(names):
        raise MessageError(f"it has {len(names)} names, but {len(numbers)} numbers in '{kind}'")
    values = {JointColumn(kind, name): float(number) for name, number in zip(names, numbers, strict=False)}
    return {
        column: _finite(number, f"the {kind} of joint '{column.joint}'")
        for column, number in values.items()
        if not math.isnan(number)
    }


def _array(message: Any, selection: MessageSelection) -> JointRow | None:
    numbers = message.data.tolist()
    if len(numbers) != len(selection.joints):
        raise MessageError(
            f"it has {len(numbers)} numbers for {len(selection.joints)} joints: {', '.join(selection.joints)}"
        )
    return _row(selection.joints, selection.interface, numbers) or None


def _trajectory(message: Any, _: MessageSelection) -> Trajectory:
    names = tuple(message.joint_names)
    points: list[TrajectoryPoint] = []
    for index, point in enumerate(message.points):
        place, numbers = f"points[{index}]", []
        for group in ("positions", "velocities", "accelerations"):
            values = getattr(point, group)
            if len(values) not in ((len(names),) if group == "positions" else (0, len(names))):
                raise MessageError(f"{place} has {len(values)} {group} for {len(names)} joints")
            numbers.append(tuple(_finite(value, f"{place}.{group}") for value in values.tolist()))
        time = int(point.time_from_start.sec) + int(point.time_from_start.nanosec) / 1e9
        if time < 0 or (points and time <= points[-1].time):
            raise MessageError(f"{place} is at {time:g} s, not later than the point before")
        points.append(TrajectoryPoint(time, *numbers))
    return Trajectory(names, tuple(points))


class _Kind(NamedTuple):
    """The conversion of a type of messages; None as the content is a message without a finite value."""

    content: Callable[[Any, MessageSelection], Content | None]
    has_header: bool


TYPES: Final[Mapping[str, _Kind]] = MappingProxyType(
    {
        "geometry_msgs/msg/Twist": _Kind(_twist, has_header=False),
        "geometry_msgs/msg/TwistStamped": _Kind(lambda message, part: _twist(message.twist, part), has_header=True),
        "ackermann_msgs/msg/AckermannDrive": _Kind(_steering, has_header=False),
        "ackermann_msgs/msg/AckermannDriveStamped": _Kind(
            lambda message, part: _steering(message.drive, part), has_header=True
        ),
        "sensor_msgs/msg/JointState": _Kind(_joint_state, has_header=True),
        "trajectory_msgs/msg/JointTrajectory": _Kind(_trajectory, has_header=True),
        ARRAY: _Kind(_array, has_header=False),
    }
)
"""The type of a message -> its conversion."""

_CAR: Final = "\n".join(
    f"float32 {name}" for name in ("steering_angle", "steering_angle_velocity", "speed", "acceleration", "jerk")
)
DEFINITIONS: Final = MappingProxyType(
    {
        "ackermann_msgs/msg/AckermannDrive": _CAR,
        "ackermann_msgs/msg/AckermannDriveStamped": (
            f"std_msgs/Header header\nackermann_msgs/AckermannDrive drive\n{'=' * 80}\n"
            f"MSG: ackermann_msgs/AckermannDrive\n{_CAR}"
        ),
    }
)
"""The definitions of types that `rosbags` lacks."""
