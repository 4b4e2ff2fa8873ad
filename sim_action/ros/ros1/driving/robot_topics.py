"""What the topics of a robot are called."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from sim_action.core.messages import did_you_mean
from sim_action.core.yaml_errors import SpecProblems
from sim_action.world.scene import Fitting

COMMANDS: Final = "cmd_vel"
JOINTS: Final = "joint_states"
ODOMETRY: Final = "odom"

_OF_SENSORS: Final = {
    "lidar": "scan",
    "imu": "imu",
    "odometry": ODOMETRY,
    "camera": "image_raw",
    "contact": "contact",
}


def topics_of(sensors: Sequence[Fitting], stated: Mapping[str, str]) -> dict[str, str]:
    """Each topic by what it is of: `cmd_vel`, `joint_states`, `odom` where no sensor tells odometry, and sensors."""
    found = {COMMANDS: "/cmd_vel", JOINTS: "/joint_states"}
    if not any(sensor.kind == "odometry" for sensor in sensors):
        found[ODOMETRY] = "/odom"
    found |= {sensor.name: _topic(sensor, sensors) for sensor in sensors if sensor.kind in _OF_SENSORS}
    return {name: f"/{stated.get(name, topic).lstrip('/')}" for name, topic in found.items()}


def topic_problems(stated: Mapping[str, str], sensors: Sequence[Fitting]) -> SpecProblems:
    """Names of what the robot has not, and topics that several have; by their keys."""
    topics = topics_of(sensors, stated)
    for name in stated:
        if name not in topics:
            yield (name,), f"the robot has no '{name}' to be told of{did_you_mean(name, topics)}"
    yield from (((name,), message) for name, message in _twice(stated, topics))


def _twice(stated: Mapping[str, str], topics: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    for name in stated:
        others = [other for other, topic in topics.items() if other != name and topic == topics.get(name)]
        if others:
            yield name, f"'{topics[name]}' is the topic of '{others[0]}' already"


def _topic(sensor: Fitting, sensors: Sequence[Fitting]) -> str:
    kind = _OF_SENSORS[sensor.kind]
    is_alone = sum(other.kind == sensor.kind for other in sensors) == 1
    if sensor.kind == "camera" or not is_alone:
        plain = re.sub(r"\W", "_", sensor.name, flags=re.ASCII)
        return f"/{plain if plain[:1].isalpha() else f'sensor_{plain}'}/{kind}"
    return f"/{kind}"
