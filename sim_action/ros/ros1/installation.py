"""The installation of ROS 1: packages of the distribution, for the Python of the distribution."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Final

from sim_action.core.errors import UsageError
from sim_action.core.records import dataclass

PACKAGES: Final = (
    "python3-rospy",
    "python3-rostest",
    "python3-roslaunch",
    "python3-geometry-msgs",
    "python3-nav-msgs",
    "python3-sensor-msgs",
    "python3-std-srvs",
    "python3-tf2-msgs",
    "python3-trajectory-msgs",
    "ros-geometry-msgs",
    "ros-std-msgs",
)
"""The Debian and Ubuntu packages of ROS 1 that sim-action needs."""

INSTALLING: Final = f"sudo apt-get install --no-install-recommends {' '.join(PACKAGES)}"

PYTHON: Final = Path("/usr/bin/python3")
"""The Python of the distribution's packages, even if another one is first on PATH."""

_FIND_MODULES: Final = """\
import importlib.util
names = "rospy rostest roslaunch genpy geometry_msgs nav_msgs sensor_msgs std_srvs tf2_msgs trajectory_msgs".split()
found = {name: importlib.util.find_spec(name) for name in names}
print(",".join(name for name, spec in found.items() if spec is None))
print(found["rospy"].submodule_search_locations[0] if found["rospy"] else "")
"""


@dataclass(frozen=True, slots=True)
class Ros:
    """An installation of ROS 1: an interpreter that has its modules, and the folder of these."""

    python: Path
    modules: Path

    @property
    def prefix(self) -> Path:
        """The installation prefix: /usr, or /opt/ros/noetic where that is sourced."""
        return self.modules.parents[2]

    @property
    def share(self) -> Path:
        """The folder of all its packages."""
        return self.prefix / "share"

    def program(self, name: str) -> Path:
        """Return the path of a program, such as rostest."""
        return self.prefix / "bin" / name


def find_ros(python: Path | None = None) -> Ros:
    """Return the ROS 1 of the distribution. Raises UsageError if it is missing or incomplete."""
    python = python or PYTHON
    missing, modules = _look(python) if python.exists() else (["rospy"], None)
    if modules and not missing:
        ros = Ros(python, modules)
        needed = ros.share / "geometry_msgs/msg/Pose.msg"
        if needed.exists():
            return ros
        missing = [str(needed)]
    raise UsageError(f"ROS 1 is not installed: {python} has no {', no '.join(missing)}; run {INSTALLING}")


def _look(python: Path) -> tuple[list[str], Path | None]:
    command = [str(python), "-c", _FIND_MODULES]
    printed = subprocess.run(command, capture_output=True, text=True, check=False, cwd="/").stdout  # noqa: S603 - that one
    missing, _, rospy = printed.partition("\n")
    return [name for name in missing.split(",") if name], Path(rospy.strip()).parent if rospy.strip() else None
