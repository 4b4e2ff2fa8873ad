"""Messages of ROS that a robot is told where to go with -> commands."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final

from sim_action.commands.logs.joint_columns import KINDS, JointColumn, followed, targets
from sim_action.core.geometry import Twist, Vector3
from sim_action.state.command import Command, is_finite


class MessageError(ValueError):
    """A message that no robot can be told."""


def command_of(type_name: str, message: Any) -> Command:
    """What a message of one of `TYPES` tells a robot. Raises MessageError."""
    command = TYPES[type_name](message)
    if not is_finite(command):
        raise MessageError("a value of it is not finite")
    return command


def _twist(message: Any) -> Twist:
    return Twist(_vector(message.linear), _vector(message.angular))


def _vector(message: Any) -> Vector3:
    return (float(message.x), float(message.y), float(message.z))


def _stamped_twist(message: Any) -> Twist:
    return _twist(message.twist)


def _joint_state(message: Any) -> Command:
    names = list(message.name)
    if len(set(names)) != len(names):
        raise MessageError("a joint is named twice in it")
    values: dict[JointColumn, float] = {}
    for kind in KINDS:
        numbers: Sequence[float] = getattr(message, kind).tolist()
        if numbers and len(numbers) != len(names):
            raise MessageError(f"it has {len(names)} names, and {len(numbers)} numbers in '{kind}'")
        values.update((JointColumn(kind, name), number) for name, number in zip(names, numbers, strict=False))
    if not values:
        raise MessageError("it has no position, no velocity and no effort")
    columns = list(values)
    return targets((columns[place], values[columns[place]]) for place in followed(columns))


TYPES: Final[Mapping[str, Callable[[Any], Command]]] = MappingProxyType(
    {
        "geometry_msgs/msg/Twist": _twist,
        "geometry_msgs/msg/TwistStamped": _stamped_twist,
        "sensor_msgs/msg/JointState": _joint_state,
    }
)
"""Type of a message -> how it is read."""
