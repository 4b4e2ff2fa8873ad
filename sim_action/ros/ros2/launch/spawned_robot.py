"""The robot that a launch test spawns by `ros_gz_sim create`: its description and its pose."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from sim_action.core.errors import ScriptError
from sim_action.core.field_types import Placement
from sim_action.core.records import dataclass
from sim_action.ros.ros2.bridge_link import Endpoint
from sim_action.ros.ros2.quality import LATCHED

if TYPE_CHECKING:
    from sim_action.ros.ros2.bridge_link import Bridge
    from sim_action.ros.ros2.launch.gazebo_programs import LeftOutProgram

SPAWNERS: Final = frozenset({"ros_gz_sim/create", "ros_ign_gazebo/create"})
_SOURCES: Final = ("-topic", "-string", "-file")
_TEXT: Final = "std_msgs/msg/String"
_MAX_WAIT_S: Final = 20.0
_POLL_S: Final = 0.01


@dataclass(frozen=True, slots=True)
class SpawnedRobot:
    """The robot of a launch test; `file`: its description."""

    name: str
    file: Path
    pose: Placement


def spawned_robot(programs: Sequence[LeftOutProgram], bridge: Bridge, folder: Path) -> SpawnedRobot:
    """Return the robot that a launch spawns; `folder`: for its description. Raise ScriptError, BridgeEnded."""
    spawned = [_options(each.args) for each in programs if each.program in SPAWNERS]
    robots = [options for options in spawned if "-file" not in options] or spawned
    if not robots:
        raise ScriptError("the launch spawns no robot: no action runs 'create' of ros_gz_sim")
    options = robots[0]
    source = next((key for key in _SOURCES if key in options), None)
    if source is None:
        raise ScriptError("'create' of ros_gz_sim has none of -topic, -string and -file, so there is no robot to spawn")
    name = options.get("-name", "robot")
    if source == "-file":
        return SpawnedRobot(name, Path(options[source]), _pose(options))
    text = options[source] if source == "-string" else _heard("/" + options[source].lstrip("/"), bridge)
    file = folder / "robot.urdf"
    file.write_text(text, encoding="utf-8")
    return SpawnedRobot(name, file, _pose(options))


def _options(args: Sequence[str]) -> Mapping[str, str]:
    """Return the options of `create` with their values; both `-x 1` and `--x=1` are allowed."""
    found: dict[str, str] = {}
    words = iter(args)
    for word in words:
        if word == "--ros-args":
            break
        if word.startswith("-"):
            name, sign, value = word.partition("=")
            found["-" + name.lstrip("-")] = value if sign else next(words, "")
    return found


def _pose(options: Mapping[str, str]) -> Placement:
    """Return the pose. At a height of 0 or less, the robot stands on the ground. Raise ScriptError."""
    names = {"-x": "x", "-y": "y", "-z": "z", "-R": "roll", "-P": "pitch", "-Y": "yaw"}
    values: dict[str, float] = {}
    for option, name in names.items():
        try:
            values[name] = float(options.get(option, 0.0))
        except ValueError:
            raise ScriptError(f"'create {option} {options[option]}': this is not a number") from None
    return Placement.model_validate({**values, "z": values["z"] if values["z"] > 0 else None})


def _heard(topic: str, bridge: Bridge) -> str:
    """Return the text of a topic such as /robot_description. Raise ScriptError, BridgeEnded."""
    number = len(bridge.heard)
    bridge.open((), [Endpoint(topic, _TEXT, LATCHED)])
    deadline = time.monotonic() + _MAX_WAIT_S
    while time.monotonic() < deadline:
        for place, message in bridge.take(())[0]:
            if place == number:
                return str(message["data"])
        time.sleep(_POLL_S)
    raise ScriptError(f"no description of the robot arrived on {topic} within {_MAX_WAIT_S:g} s of wall time")
