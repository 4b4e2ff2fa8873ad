"""The packages of Gazebo that launch files look for: a prefix with launch files that start the simulator's stand-in.

They hide packages of the same names that are installed. Programs of these packages need no files: the launcher knows
them by their names.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

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
