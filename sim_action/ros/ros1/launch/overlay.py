"""What a ROS 1 workspace finds here before anything else: packages that stand in for Gazebo, and their nodes.

An overlay is a folder of its own for each call. In it:

    share/   packages: ours, the user's and the distribution's, each as a link; rospkg looks through no other folder
    bin/     a `python` that has rospy, since nodes begin with `#!/usr/bin/env python`
    modules/ gazebo_msgs, controller_manager_msgs, and messages of the user's packages, as genpy writes them
"""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sim_action.core.errors import UsageError
from sim_action.ros.ros1.catkin_packages import exported_models, packages_below, packages_of, sources
from sim_action.ros.ros1.installation import Ros
from sim_action.runner.isolation.child_process import environment

_SITE: Final = Path(__file__).with_name("ros_patches.py")
_PACKAGES: Final = Path(__file__).parent / "packages"
PACKAGE_ROOT: Final = str(Path(__file__).resolve().parents[4])
"""Where this package is imported from."""

_PROGRAMS: Final = "sim_action.ros.ros1.launch.programs"
_XACRO: Final = "sim_action.ros.ros1.launch.xacro"
# Package and name of a node -> the module of ours that is run, and its first arguments.
_NODES: Final = {
    ("gazebo_ros", "gzserver"): f"{_PROGRAMS} gzserver",
    ("gazebo_ros", "gazebo"): f"{_PROGRAMS} gzserver",
    ("gazebo_ros", "spawn_model"): f"{_PROGRAMS} spawn_model",
    ("controller_manager", "spawner"): f"{_PROGRAMS} spawner",
    ("controller_manager", "unspawner"): f"{_PROGRAMS} unspawner",
    ("controller_manager", "controller_manager"): f"{_PROGRAMS} controller_manager",
    ("xacro", "xacro"): _XACRO,
    ("xacro", "xacro.py"): _XACRO,
}
# Theirs count before ours; of the others, only ours do what sim-action does.
_FALLBACKS: Final = frozenset({"turtlebot3_gazebo", "turtlebot3_description"})


@dataclass(frozen=True, slots=True)
class Overlay:
    """An overlay that is ready.

    Attributes:
        variables: all that a process needs to see it, but PYTHONPATH.
        python_path: PYTHONPATH, for the distribution's Python.
        packages: name -> folder of all that there are.
    """

    variables: Mapping[str, str]
    python_path: str
    packages: Mapping[str, Path]


def build_overlay(folder: Path, ros: Ros, workspace: Path) -> Overlay:
    """Writes the overlay into an empty folder. Raises UsageError."""
    share, programs, modules = (folder / name for name in ("share", "bin", "modules"))
    for made in (share, programs, modules):
        made.mkdir()
    ours = packages_of([_PACKAGES])
    stand_ins = {name: path for name, path in ours.items() if name not in _FALLBACKS}
    users = dict(packages_below(sources(workspace)))
    packages = {**packages_of([ros.share]), **ours, **packages_of(_paths("ROS_PACKAGE_PATH")), **users, **stand_ins}
    for name, path in packages.items():
        if path == ours.get(name):
            _lay_out(name, path, share / name)
        else:
            (share / name).symlink_to(path)
    generate_messages({**users, **stand_ins}, packages, modules, ros)
    (modules / "sitecustomize.py").symlink_to(_SITE)
    for name in ("python", "python3"):
        _write_program(programs / name, f'exec {ros.python} "$@"')
    python_path = os.pathsep.join((str(modules), *_modules_of(users), *_paths("PYTHONPATH")))
    return Overlay(_variables(folder, ros, workspace, packages), python_path, packages)


def _variables(folder: Path, ros: Ros, workspace: Path, packages: Mapping[str, Path]) -> dict[str, str]:
    built = [str(path) for path in (workspace / "devel", workspace / "install") if path.is_dir()]
    return {
        **environment(),
        "PATH": os.pathsep.join((str(folder / "bin"), os.environ.get("PATH", os.defpath))),
        "ROS_PACKAGE_PATH": str(folder / "share"),
        "ROS_ROOT": str(ros.share / "ros"),
        "ROS_HOME": str(folder / "home"),
        "ROS_HOSTNAME": "localhost",
        "ROS_MASTER_URI": "http://localhost:11311",
        "CMAKE_PREFIX_PATH": os.pathsep.join((*built, str(ros.prefix))),
        "GAZEBO_MODEL_PATH": os.pathsep.join((*_paths("GAZEBO_MODEL_PATH"), *exported_models(packages.values()))),
        "ROS_DISTRO": os.environ.get("ROS_DISTRO", "noetic"),
        "TURTLEBOT3_MODEL": os.environ.get("TURTLEBOT3_MODEL") or "burger",
    }


def _paths(variable: str) -> list[str]:
    return [path for path in os.environ.get(variable, "").split(os.pathsep) if path and path != PACKAGE_ROOT]


def _modules_of(users: Mapping[str, Path]) -> Iterator[str]:
    """Where packages have modules of their own, which a build would have copied."""
    return (str(path / "src") for path in users.values() if (path / "setup.py").is_file() and (path / "src").is_dir())


def _lay_out(name: str, source: Path, target: Path) -> None:
    """A package of ours, with its nodes."""
    target.mkdir()
    for path in source.iterdir():
        (target / path.name).symlink_to(path)
    for (package, node), module in _NODES.items():
        if package == name:
            # Models are looked for where an overlay's packages are, which are links: of ROS 2's path they are followed.
            prefix = shlex.quote(str(target.parent.parent))
            variables = f"PYTHONPATH={shlex.quote(PACKAGE_ROOT)}:$PYTHONPATH AMENT_PREFIX_PATH={prefix}"
            _write_program(target / node, f'{variables} exec {shlex.quote(sys.executable)} -m {module} "$@"')
    if name == "gazebo_ros":
        # There is no window, and nobody misses it.
        _write_program(target / "gzclient", "exit 0")


def _write_program(path: Path, line: str) -> None:
    path.write_text(f"#!/bin/sh\n{line}\n")
    path.chmod(0o755)


_KINDS: Final = ("msg", "srv")

# One interpreter for all: to start one for each kind of each package takes longer than what they do.
_GENERATION: Final = """\
import json, os, sys
from genpy.generator import MsgGenerator, SrvGenerator
from genpy.generate_initpy import write_modules
task = json.load(sys.stdin)
for package, kinds in task["packages"].items():
    for kind, generator in (("msg", MsgGenerator()), ("srv", SrvGenerator())):
        if kinds[kind]:
            folder = os.path.join(task["modules"], package, kind)
            os.mkdir(folder)
            code = generator.generate_messages(package, kinds[kind], folder, task["includes"])
            if code:
                sys.exit(code)
            write_modules(folder)
"""

# A package may have modules of its own beside those that are written here.
_INIT: Final = '__path__ = __import__("pkgutil").extend_path(__path__, __name__)\n'


def generate_messages(packages: Mapping[str, Path], known: Mapping[str, Path], modules: Path, ros: Ros) -> None:
    """Writes modules below a folder, for packages by name; `known`: all whose messages theirs may hold.

    Raises UsageError.
    """
    definitions = {name: _definitions(folder) for name, folder in packages.items()}
    written = {name: kinds for name, kinds in definitions.items() if any(kinds.values())}
    for name in written:
        (modules / name).mkdir()
        (modules / name / "__init__.py").write_text(_INIT)
    includes = {name: [str(folder / "msg")] for name, folder in known.items() if (folder / "msg").is_dir()}
    task = json.dumps({"packages": written, "modules": str(modules), "includes": includes})
    command = [str(ros.python), "-c", _GENERATION]
    # What it reads comes on standard input.
    made = subprocess.run(  # noqa: S603 - the distribution's Python and a program of ours
        command, input=task, capture_output=True, text=True, check=False, cwd="/"
    )
    if made.returncode:
        said = (made.stderr.strip() or made.stdout.strip()).splitlines()[-1:]
        raise UsageError(f"genpy cannot generate the messages of {', '.join(written)}: {' '.join(said)}")


def _definitions(package: Path) -> dict[str, list[str]]:
    return {kind: [str(file) for file in sorted((package / kind).glob(f"*.{kind}"))] for kind in _KINDS}


# Where to go if TMPDIR cannot be had.
_TEMPORARY: Final = ("/tmp", "/var/tmp")  # noqa: S108 - a folder with a random name is made in it
_SPLIT: Final = re.compile(r"[\s'\"\\$]")


def scratch_parent() -> str:
    """A folder for folders of calls. Raises UsageError.

    roslaunch splits `$(find xacro)/xacro ...` at blanks once it has put the paths in.
    """
    for folder in (tempfile.gettempdir(), *_TEMPORARY):
        if not _SPLIT.search(os.path.realpath(folder)) and os.access(folder, os.W_OK | os.X_OK):
            return folder
    raise UsageError(
        f"'{tempfile.gettempdir()}' contains a blank or a quote, and roslaunch splits commands there; "
        "set TMPDIR to a folder without them"
    )
