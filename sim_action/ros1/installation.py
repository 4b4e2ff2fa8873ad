"""Where ROS 1 is on this machine: the distribution's own packages, for the distribution's own Python."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sim_action.errors import UsageError

PACKAGES: Final = (
    "python3-rospy",
    "python3-rostest",
    "python3-roslaunch",
    "python3-geometry-msgs",
    "python3-nav-msgs",
    "python3-sensor-msgs",
    "python3-std-srvs",
    "python3-tf2-msgs",
    "ros-geometry-msgs",
    "ros-std-msgs",
)
"""What Debian and Ubuntu call what is needed of ROS."""

INSTALLING: Final = f"apt-get install --no-install-recommends {' '.join(PACKAGES)}"

PYTHON: Final = Path("/usr/bin/python3")
"""The one that the distribution's packages are for, whichever is first on PATH."""

_LOOK: Final = """\
import importlib.util
names = ("rospy", "rostest", "roslaunch", "genpy", "geometry_msgs", "nav_msgs", "sensor_msgs", "std_srvs", "tf2_msgs")
found = {name: importlib.util.find_spec(name) for name in names}
print(",".join(name for name, spec in found.items() if spec is None))
print(found["rospy"].submodule_search_locations[0] if found["rospy"] else "")
"""


@dataclass(frozen=True, slots=True)
class Ros:
    """An installation of ROS 1.

    Attributes:
        python: an interpreter that has its modules.
        modules: the folder that they are in.
        share: the folder that has a folder for each of its packages.
    """

    python: Path
    modules: Path
    share: Path = Path("/usr/share")


def find_ros() -> Ros:
    """The distribution's. Raises UsageError if it is not here, or not whole."""
    missing, rospy = _look() if PYTHON.exists() else (["rospy"], "")
    definitions = Path("/usr/share/geometry_msgs/msg/Pose.msg")
    if not missing and not definitions.exists():
        missing = [str(definitions)]
    if missing:
        raise UsageError(
            f"ROS 1 is not installed here: {PYTHON} has no {', no '.join(missing)}; on Debian 12 and Ubuntu: {INSTALLING}"
        )
    return Ros(PYTHON, Path(rospy).parent)


def _look() -> tuple[list[str], str]:
    told = subprocess.run([PYTHON, "-c", _LOOK], capture_output=True, text=True, check=False, cwd="/").stdout
    missing, _, rospy = told.partition("\n")
    return [name for name in missing.split(",") if name], rospy.strip()
