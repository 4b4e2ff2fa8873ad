"""Install prefixes and workspaces of ROS 2 as folders: what colcon, ament and the wheels write, without their code."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tests.ros_workspace import written

PACKAGES = (
    *("geometry_msgs", "nav_msgs", "rosgraph_msgs", "sensor_msgs", "std_msgs", "trajectory_msgs"),
    "rmw_fastrtps_cpp",
)
JAZZY, KILTED, HUMBLE = "7.1.5", "9.1.2", "3.3.16"

SETUP = """\
from setuptools import find_packages, setup

package_name = 'my_robot'

setup(
    name=package_name,
    packages=find_packages(exclude=['test']),
    entry_points={
        'console_scripts': [
            'mover = my_robot.mover:main',
        ],
    },
)
"""


def manifest(folder: Path, name: str, build_type: str | None = "ament_python", version: str = "0.0.0") -> None:
    export = f"<export><build_type>{build_type}</build_type></export>" if build_type else ""
    text = (
        f'<?xml version="1.0"?>\n<package format="3"><name>{name}</name><version>{version}</version>{export}</package>'
    )
    written(folder / "package.xml", text)


def installed(prefix: Path, package: str, hooks: str = "", version: str = "0.0.0") -> Path:
    """Installs a package in a prefix; `hooks`: the lines of its package.dsv."""
    manifest(prefix / "share" / package, package, version=version)
    written(prefix / "share/ament_index/resource_index/packages" / package, "")
    written(prefix / "share" / package / "package.dsv", hooks)
    return prefix


def ros_prefix(prefix: Path, version: str = JAZZY, *, missing: str = "", wheels: bool = False) -> Path:
    """A prefix of ROS 2 with Python 3.12; `wheels`: the prefix of a virtual environment."""
    modules = "lib/python3.12/site-packages"
    installed(prefix, "rclpy", f"prepend-non-duplicate;PYTHONPATH;{modules}\n", version)
    for package in PACKAGES:
        if package != missing:
            installed(prefix, package, "prepend-non-duplicate;LD_LIBRARY_PATH;lib\n")
    (prefix / modules / "rclpy").mkdir(parents=True)
    if wheels:
        (prefix / modules / "ros_rcl.libs").mkdir()
    program(prefix / "bin/python3.12")
    program(prefix / "bin/python")
    return prefix


def program(path: Path, text: str = "#!/bin/sh\n") -> Path:
    written(path, text).chmod(0o755)
    return path


def source(workspace: Path, name: str = "my_robot", files: Mapping[str, str] | None = None) -> Path:
    """A package of ament_python in the `src` of a workspace, with the executable mover."""
    folder = workspace / "src" / name
    manifest(folder, name)
    written(folder / name / "__init__.py", "")
    for path, text in (files or {"setup.py": SETUP}).items():
        written(folder / path, text)
    return folder
