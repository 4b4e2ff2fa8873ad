"""Checks of the packages, executables and files that a scenario names; none of them is run.

A package that is not in the workspace may belong to ROS 2. Where ROS 2 is not installed, it is not checked.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Final

from sim_action.core.wording import did_you_mean
from sim_action.core.workspace import PathError, Workspace, similar_name
from sim_action.core.yaml_document import SpecProblems
from sim_action.robot.documents.package_search import PACKAGE_FILE
from sim_action.ros.launches import argument_problem, installed
from sim_action.ros.ros2.installation import Ros2, find_ros
from sim_action.ros.ros2.packages import BUILD, INSTALL, UNREADABLE, Packages, is_python, workspace_of

if TYPE_CHECKING:
    from sim_action.ros.ros2.spec import Ros2Nodes, Ros2NodeSpec

_CONTAINER: Final = ", in a ROS 2 with rclcpp, such as the container ros:jazzy"


@cache
def local_ros() -> tuple[Ros2 | None, str | None]:
    """Return the installation, or None and the reason why there is none."""
    return installed(find_ros, "nodes of ROS 2 run on Linux only: sim-action watches their threads in /proc")


def file_problems(spec: Ros2Nodes, workspace: Workspace) -> SpecProblems:
    """Yield problems, by their keys below `ros2`."""
    if problems := list(spec.problems("drive.launch.py")):
        yield from problems
        return
    try:
        folder = workspace_of(spec.workspace, workspace)
    except PathError as error:
        yield ("workspace",), f"{error}{_build_hint(spec.workspace, workspace)}"
        return
    try:
        packages = Packages.around(folder, local_ros()[0])
    except PathError as error:
        yield ("workspace",) if spec.workspace is not None else (), str(error)
        return
    if spec.workspace is not None and not packages.installed and not packages.sources:
        yield ("workspace",), f"'{spec.workspace}' has no packages; {BUILD} in the workspace, or name another folder"
    elif spec.launch:
        yield from _launch_problems(spec.launch, packages)
    else:
        yield from _node_problems(spec.nodes or (), packages, workspace)


def _build_hint(stated: str | None, workspace: Workspace) -> str:
    """Return the end of a message about a missing folder: how to make an install folder."""
    path = workspace.directory / (stated or "")
    if path.name != INSTALL or not _exists(path.parent):
        return ""
    unneeded = "or leave out 'workspace' if all packages are of ament_python, which need no build"
    return f"; the workspace is not built: {BUILD} in {path.parent}, {unneeded}"


def _launch_problems(launch: Sequence[str], packages: Packages) -> SpecProblems:
    package, name, *arguments = launch
    if problem := package_problem(package, packages):
        yield ("launch", 0), problem
        return
    if package not in packages.sources and packages.prefix(package) is None:
        return
    files = packages.launch_files(package)
    if name not in files:
        near = did_you_mean(name, files) if files else ", and no other one"
        yield ("launch", 1), f"the package '{package}' has no launch file '{name}'{near}"
    for index, argument in enumerate(arguments):
        if problem := argument_problem(argument):
            yield ("launch", index + 2), problem


def _node_problems(nodes: Sequence[Ros2NodeSpec], packages: Packages, workspace: Workspace) -> SpecProblems:
    started: dict[tuple[str, str], str] = {}
    for index, node in enumerate(nodes):
        key = ("/" + (node.namespace or "").strip("/"), node.called)
        if key in started:
            other = "another one" if started[key] == node.program else f"'{started[key]}'"
            same = f"'{node.program}' has the name '{node.called}', as {other}"
            yield ("nodes", index), f"two nodes of one name: {same}; give each its own 'name' or 'namespace'"
        started.setdefault(key, node.program)
        if node.file is not None:
            problem = _file_problem(node.file, workspace) or _module_problem(workspace.file(node.file), packages)
        else:
            problem = executable_problem(str(node.package), str(node.executable), packages)
            program = packages.program(str(node.package), str(node.executable))
            hinted = f"{problem}{_file_hint(node, workspace)}" if problem else None
            problem = hinted or (_module_problem(program, packages) if program else None)
        if problem:
            yield ("nodes", index), problem


def _module_problem(program: Path, packages: Packages) -> str | None:
    """Return which modules a program in Python lacks, and the remedy; None if it lacks none, or cannot be checked."""
    if packages.ros is None or not is_python(program) or not (missing := packages.missing_modules(program)):
        return None
    names = ", ".join(f"'{name}'" for name in missing)
    if packages.sources.keys() >= {*missing}:
        fix = f"sim-action ros2 prepare {packages.workspace}, or {BUILD.removeprefix('run ')}"
        return f"'{program.name}' imports {names} of the workspace, which is not built: run {fix}"
    fix = "install them for it; the wheels of PyPI lack many packages of ROS 2, which a container such as ros:jazzy has"
    return f"'{program.name}' imports {names}, and {packages.ros.python} has no such module: {fix}"


def _file_hint(node: Ros2NodeSpec, workspace: Workspace) -> str:
    is_file = _exists(workspace.directory / node.program)
    return f"; if you mean the file, write ./{node.program}" if is_file else ""


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except OSError:  # too long, or in a folder that cannot be read
        return False


def _file_problem(file: str, workspace: Workspace) -> str | None:
    try:
        path = workspace.file(file)
    except PathError as error:
        return f"{error}{_similar(file, workspace)}"
    if is_python(path) or os.access(path, os.X_OK):
        return None
    fix = f"run chmod +x {file} and git update-index --chmod=+x {file}"
    return f"'{file}' is not executable, and is not a file of Python (.py); {fix}"


def _similar(file: str, workspace: Workspace) -> str:
    """Return the hint at a similar name, if a missing file may be read."""
    place = workspace.directory / file
    try:
        is_readable = workspace.refusal(place.resolve()) is None
    except (OSError, ValueError, RuntimeError):  # no valid path, or a loop of links
        return ""
    return similar_name(place) if is_readable and not _exists(place) else ""


def package_problem(name: str, packages: Packages) -> str | None:
    """Return the reason why a package cannot be used; None if it can, or cannot be checked."""
    source = packages.sources.get(name)
    if source is not None and source.build_type == UNREADABLE:
        return f"the package '{name}' cannot be read: {source.folder / PACKAGE_FILE} is not valid XML"
    if source is not None and not source.is_python:
        kind = f"its build type is {source.build_type}, and only packages of Python programs run without a build"
        place = packages.workspace.parent if packages.workspace.name == INSTALL else packages.workspace
        lacks = packages.ros is not None and "rclcpp" not in packages.distributed
        fix = f"{BUILD} in {place}{_CONTAINER if lacks else ''}"
        return f"the package '{name}' in {source.folder} is not built: {kind}; {fix}"
    if source is not None or packages.prefix(name) is not None or packages.ros is None:
        return None
    near = did_you_mean(name, packages.names)
    return f"there is no package '{name}' in {packages.workspace} or ROS 2{near}"


def executable_problem(package: str, name: str, packages: Packages) -> str | None:
    """Return the reason why an executable of a package cannot be a node; None if it can, or cannot be checked."""
    if problem := package_problem(package, packages):
        return problem
    source = packages.sources.get(package)
    if source is None and packages.prefix(package) is None:
        return None
    programs = packages.executables(package)
    if name in programs:
        path = programs[name]
        can_run = path is None or is_python(path) or os.access(path, os.X_OK)
        return None if can_run else f"'{name}' of '{package}' is not executable; run chmod +x {path}"
    near = did_you_mean(name, programs) if programs else ""
    missing = f"the package '{package}' has no executable '{name}'"
    if source is None:
        fix = "; add it to entry_points in setup.py or to install() in CMakeLists.txt, and build again"
        return f"{missing}{near}{fix if package in packages.installed else ''}"
    if source.unread:
        missing += f" that can be read from {source.folder / source.unread}, which computes its entry points"
    fix = f"write them as constants, or {BUILD}" if source.unread else f"add it to {source.setup_file}"
    return f"{missing}{near}; {fix}"
