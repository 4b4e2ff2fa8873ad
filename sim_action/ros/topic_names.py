"""The names of a robot's topics: usual ones, and those that a scenario states by their keys."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Final

from sim_action.core.wording import did_you_mean
from sim_action.core.yaml_errors import SpecProblems
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


def topics_of(
    sensors: Sequence[Fitting], stated: Mapping[str, str], robot: Mapping[str, str] = ROBOT_TOPICS
) -> dict[str, str]:
    """Return the topics of a robot, by their keys.

    The keys are those of `robot` (`odom` only if no sensor measures odometry) and the names of sensors.
    """
    measured = any(sensor.kind == "odometry" for sensor in sensors)
    found = {name: topic for name, topic in robot.items() if name != ODOMETRY or not measured}
    found |= {sensor.name: _topic(sensor, sensors) for sensor in sensors if sensor.kind in _SENSOR_TOPICS}
    return {name: f"/{stated.get(name, topic).lstrip('/')}" for name, topic in found.items()}


def topic_problems(stated: Mapping[str, str], topics: Mapping[str, str]) -> SpecProblems:
    """Yield problems of stated topics, by their keys: unknown names, and topics that are used twice.

    `topics`: those of the robot, with the stated ones.
    """
    for name in stated:
        if name not in topics:
            yield (name,), f"the robot has no '{name}'{did_you_mean(name, topics)}"
    yield from (((name,), message) for name, message in _twice(stated, topics))


def _twice(stated: Mapping[str, str], topics: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    for name in stated:
        others = [other for other, topic in topics.items() if other != name and topic == topics.get(name)]
        if others:
            yield name, f"'{topics[name]}' is already the topic of '{others[0]}'"


def plain_name(name: str) -> str:
    """Return the name of a sensor as a name of ROS: letters, digits and underscores, beginning with a letter."""
    plain = re.sub(r"\W", "_", name, flags=re.ASCII)
    return plain if plain[:1].isalpha() else f"sensor_{plain}"


def _topic(sensor: Fitting, sensors: Sequence[Fitting]) -> str:
    kind = _SENSOR_TOPICS[sensor.kind]
    is_alone = sum(other.kind == sensor.kind for other in sensors) == 1
    return f"/{kind}" if is_alone and sensor.kind != "camera" else f"/{plain_name(sensor.name)}/{kind}"
