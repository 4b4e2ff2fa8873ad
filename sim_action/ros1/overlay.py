"""What a ROS 1 workspace finds here before anything else: packages that stand in for Gazebo, and their nodes.

An overlay is a folder of its own for each call. In it:

    share/   packages: ours, the user's and the distribution's, each as a link; rospkg looks through no other folder
    bin/     a `python` that has rospy, since nodes begin with `#!/usr/bin/env python`
    modules/ gazebo_msgs, as genpy writes it
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

from sim_action.errors import UsageError
from sim_action.ros1.installation import Ros

_PACKAGES: Final = Path(__file__).parent / "packages"
_OURS: Final = Path(__file__).parents[2]
_PACKAGE_FILE: Final = "package.xml"

# Package and name of a node -> the module of ours that is run.
_NODES: Final = {
    ("gazebo_ros", "gzserver"): "sim_action.ros1.gzserver",
    ("gazebo_ros", "spawn_model"): "sim_action.ros1.spawn_model",
    ("xacro", "xacro"): "sim_action.ros1.xacro",
    ("xacro", "xacro.py"): "sim_action.ros1.xacro",
}
# Theirs count before ours; of the others, only ours do what sim-action does.
_FALLBACKS: Final = frozenset({"turtlebot3_gazebo", "turtlebot3_description"})


def build_overlay(folder: Path, ros: Ros, workspace: Path) -> dict[str, str]:
    """Writes the overlay into an empty folder; returns the variables that make ROS see it. Raises UsageError."""
    share, bin_folder, modules = (folder / name for name in ("share", "bin", "modules"))
    for made in (share, bin_folder, modules):
        made.mkdir()
    owners = _folders_of(_paths("ROS_PACKAGE_PATH"))
    ours = {path.name: path for path in _PACKAGES.iterdir() if (path / _PACKAGE_FILE).is_file()}
    stand_ins = {name: path for name, path in ours.items() if name not in _FALLBACKS}
    users = dict(packages_below(workspace))
    found = {**_folders_of([ros.share]), **ours, **owners, **users, **stand_ins}
    for name, path in found.items():
        if path == ours.get(name):
            _lay_out(name, path, share / name)
        else:
            (share / name).symlink_to(path)
    _generate_messages(_PACKAGES / "gazebo_msgs", modules, ros)
    _write_program(bin_folder / "python", f'exec {ros.python} "$@"')
    return {
        "PATH": os.pathsep.join((str(bin_folder), os.environ.get("PATH", os.defpath))),
        "PYTHONPATH": os.pathsep.join((str(modules), *_paths_of_users(users), *_paths("PYTHONPATH"))),
        "ROS_PACKAGE_PATH": str(share),
        "ROS_ROOT": str(ros.share / "ros"),
        "ROS_HOME": str(folder / "home"),
        "ROS_HOSTNAME": "localhost",
        "CMAKE_PREFIX_PATH": "/usr",
        "ROS_DISTRO": os.environ.get("ROS_DISTRO", "noetic"),
    }


def packages_below(folder: Path) -> Iterator[tuple[str, Path]]:
    """Name and folder of each catkin package in a folder or below it; what a build has left is passed over."""
    for parent, folders, files in os.walk(folder):
        if _PACKAGE_FILE in files:
            yield package_name(Path(parent)), Path(parent)
            folders.clear()
        elif "CATKIN_IGNORE" in files:
            folders.clear()
        folders[:] = sorted(name for name in folders if name not in {"build", "devel", "install"} and name[0] != ".")


def package_name(folder: Path) -> str:
    """As its package.xml says, else as its folder is called."""
    try:
        name = ET.parse(folder / _PACKAGE_FILE).findtext("name")  # noqa: S314 - a name is read, of a bounded file
    except ET.ParseError:
        name = None
    return (name or folder.name).strip()


def _folders_of(paths: Iterable[Path | str]) -> dict[str, Path]:
    """Packages that are right below these folders, or are these; the first of a name counts."""
    found: dict[str, Path] = {}
    for path in map(Path, paths):
        for package in sorted([path / _PACKAGE_FILE, *path.glob(f"*/{_PACKAGE_FILE}")]):
            if package.is_file():
                found.setdefault(package.parent.name, package.parent)
    return found


def _paths(variable: str) -> list[str]:
    return [path for path in os.environ.get(variable, "").split(os.pathsep) if path]


def _paths_of_users(users: dict[str, Path]) -> Iterator[str]:
    """Where packages have modules of their own, which a build would have copied."""
    return (str(path / "src") for path in users.values() if (path / "setup.py").is_file() and (path / "src").is_dir())


def _lay_out(name: str, source: Path, target: Path) -> None:
    """A package of ours, with its nodes."""
    target.mkdir()
    for path in source.iterdir():
        (target / path.name).symlink_to(path)
    for (package, node), module in _NODES.items():
        if package == name:
            variables = f"PYTHONPATH={shlex.quote(str(_OURS))}:$PYTHONPATH"
            _write_program(target / node, f'{variables} exec {shlex.quote(sys.executable)} -m {module} "$@"')


def _write_program(path: Path, line: str) -> None:
    path.write_text(f"#!/bin/sh\n{line}\n")
    path.chmod(0o755)


def _generate_messages(package: Path, modules: Path, ros: Ros) -> None:
    """Raises UsageError."""
    target = modules / package.name
    target.mkdir()
    (target / "__init__.py").touch()
    includes = [f"-I{name}:{folder}" for name, folder in _definitions(package, ros)]
    for kind, generator in (("msg", "genmsg_py.py"), ("srv", "gensrv_py.py")):
        common = [ros.python, Path("/usr/lib/genpy") / generator, "-p", package.name, "-o", target / kind]
        files = sorted((package / kind).iterdir())
        for arguments in ([*common, *includes, *files], [*common, "--initpy"]):
            made = subprocess.run(arguments, capture_output=True, text=True, check=False, cwd="/")
            if made.returncode:
                raise UsageError(f"genpy cannot write {package.name}: {made.stderr.strip() or made.stdout.strip()}")


def _definitions(package: Path, ros: Ros) -> Iterator[tuple[str, Path]]:
    yield package.name, package / "msg"
    for name in ("geometry_msgs", "std_msgs"):
        yield name, ros.share / name / "msg"
