"""The programs of Gazebo in a launch file, with the stand-ins that run instead.

Launch files also look for packages of Gazebo: a prefix has launch files that start the stand-ins. They hide installed
packages of the same names. Programs of these packages need no files: the launcher knows them by their names.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import yaml

from sim_action.core.files import content_or_empty
from sim_action.ros.lost_parts import LeftOutProgram

_ENDS: Final = ("true",)
_STAYS: Final = ("sleep", "infinity")

FRAMES_PROGRAM: Final = "robot_state_publisher/robot_state_publisher"
"""The program that publishes the frames of links. It runs where it is installed; otherwise the robot publishes them."""

STAND_INS: Final[Mapping[str, Sequence[str]]] = {
    **dict.fromkeys(
        (
            "ros_gz_sim/create",
            "ros_gz_sim/remove",
            "ros_gz_sim/set_entity_pose",
            "ros_ign_gazebo/create",
            "gazebo_ros/spawn_entity.py",
            "controller_manager/spawner",
            "controller_manager/spawner.py",
            "controller_manager/unspawner",
        ),
        _ENDS,
    ),
    **dict.fromkeys(
        (
            *("ros_gz_sim", "ros_gz_bridge", "ros_gz_image", "ros_gz_point_cloud"),
            *("ros_ign_gazebo", "ros_ign_bridge", "ros_ign_image"),
            *("gazebo_ros", "controller_manager", "rviz2", "joint_state_publisher_gui", "joint_state_publisher"),
            *("gz", "ign", "gazebo", "gzserver", "gzclient", "rviz2", "rqt"),
            FRAMES_PROGRAM,
        ),
        _STAYS,
    ),
}
"""PACKAGE/PROGRAM, a package or a program -> the command that runs instead.

A program that ends by itself does so at once, because event handlers wait for its end. The others do nothing until the
launch is over.
"""

_PARAMETER_FILES: Final = frozenset({"-p", "--param-file"})
_MAX_PARAMETER_BYTES: Final = 1_000_000
_JOINT_STATES: Final = "joint_state_broadcaster"
_INDEX: Final = "share/ament_index/resource_index/packages"

# Package -> launch file -> command; {NAME} is the value of an argument of the launch file.
_SERVER: Final = ("gz", "sim", "{gz_args}", "{ign_args}")
_WORLD: Final = ("gz", "sim", "{world_sdf_file}")
_SPAWNED: Final = ("ros_gz_sim/create", "-name", "{entity_name}", "-topic", "{topic}", "-file", "{file}")
_CLASSIC: Final = ("gazebo", "{world}")
_LAUNCH_FILES: Final[Mapping[str, Mapping[str, tuple[str, ...]]]] = {
    "ros_gz_sim": {
        "gz_sim.launch.py": _SERVER,
        "gz_server.launch.py": _WORLD,
        "ros_gz_sim.launch.py": _WORLD,
        "gz_spawn_model.launch.py": _SPAWNED,
    },
    "ros_gz_bridge": {"ros_gz_bridge.launch.py": ("ros_gz_bridge/parameter_bridge",)},
    "ros_gz_image": {},
    "ros_ign_gazebo": {"ign_gazebo.launch.py": _SERVER},
    "ros_ign_bridge": {},
    "gazebo_ros": dict.fromkeys(("gazebo.launch.py", "gzserver.launch.py"), _CLASSIC)
    | {"gzclient.launch.py": ("gzclient",)},
}

_TEXT: Final = """\
from launch import LaunchDescription
from launch.actions import ExecuteProcess
from launch.substitutions import LaunchConfiguration


def _word(word):
    return LaunchConfiguration(word[1:-1], default="") if word.startswith("{{") else word


def generate_launch_description():
    return LaunchDescription([ExecuteProcess(cmd=[_word(word) for word in {words!r}])])
"""


def lost_controller(name: str, program: LeftOutProgram, command_topics: Collection[str]) -> str | None:
    """Return why a controller is lost for a robot with these command topics; None if it is replaced."""
    kind = dict(_types(program.args)).get(name, "")
    is_replaced = name == _JOINT_STATES or kind.startswith(f"{_JOINT_STATES}/")
    if is_replaced or any(topic.startswith(f"/{name}/") for topic in command_topics):
        return None
    stated = f"'{name}' ({kind})" if kind else f"'{name}'"
    where = f"the robot takes no commands on /{name}/...: name its topic in 'topics'"
    return f"the controller {stated} does not run, and {where}"


def _types(args: Sequence[str]) -> Iterator[tuple[str, str]]:
    for option, value in pairwise(args):
        if option in _PARAMETER_FILES:
            yield from _types_in(_parameters(Path(value)), "")


def _types_in(value: Any, name: str) -> Iterator[tuple[str, str]]:
    if not isinstance(value, dict):
        return
    if isinstance(value.get("type"), str):
        yield name, value["type"]
    for key, each in value.items():
        yield from _types_in(each, name if key == "ros__parameters" else str(key).rpartition("/")[2])


def _parameters(path: Path) -> Any:
    try:
        return yaml.safe_load(content_or_empty(path, _MAX_PARAMETER_BYTES))
    except (yaml.YAMLError, UnicodeDecodeError):
        return None


def unheard_bridges(programs: Iterable[LeftOutProgram], topics: Collection[str]) -> Iterator[str]:
    """Yield a note for each topic that a bridge would carry to ROS 2 and the robot does not publish."""
    for program in programs:
        if program.program.rpartition("/")[2] != "parameter_bridge":
            continue
        remapped = dict(
            value.split(":=", 1) for option, value in pairwise(program.args) if option == "-r" and ":=" in value
        )
        for argument in program.args:
            topic, at, rest = argument.partition("@")
            name = remapped.get(topic, topic)
            if at and "[" in rest and f"/{name.lstrip('/')}" not in topics:
                yield f"the launch file bridges {name} to ROS 2, and the robot does not publish it"


def write_prefix(folder: Path) -> Path:
    """Write the prefix into a folder that does not exist, and return it."""
    index = folder / _INDEX
    index.mkdir(parents=True)
    for package, files in _LAUNCH_FILES.items():
        (index / package).touch()
        launch = folder / "share" / package / "launch"
        launch.mkdir(parents=True)
        for name, words in files.items():
            (launch / name).write_text(_TEXT.format(words=words), encoding="utf-8")
    return folder
