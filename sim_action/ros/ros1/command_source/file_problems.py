"""Checks of the packages, launch files and nodes that a scenario names; none of them is run.

A package that is not in the workspace may belong to ROS. Where ROS is not installed, it is not checked.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Final
from xml.etree import ElementTree as ET

from sim_action.core.files import read_at_most
from sim_action.core.records import dataclass
from sim_action.core.wording import did_you_mean
from sim_action.core.workspace import PathError, Workspace
from sim_action.core.yaml_document import SpecProblems
from sim_action.ros.launches import argument_problem, installed
from sim_action.ros.ros1.catkin_packages import find_launch_file, packages_in, packages_of, workspace_of
from sim_action.ros.ros1.installation import Ros, find_ros

if TYPE_CHECKING:
    from sim_action.ros.ros1.command_source.spec import NodeSpec, RosNodes

_LAUNCH_FILES: Final = frozenset({".launch", ".test", ".xml"})
_MAX_LAUNCH_FILE_BYTES: Final = 4_000_000


@cache
def local_ros() -> tuple[Ros | None, str | None]:
    """Return the installation, or None and the reason why there is none."""
    return installed(find_ros, "ROS 1 has packages for Linux only: Debian 12 and Ubuntu")


def file_problems(spec: RosNodes, workspace: Workspace) -> SpecProblems:
    """Yield problems, by their keys below `ros1`."""
    if problems := list(spec.problems("drive.launch")):
        yield from problems
        return
    try:
        folder = workspace_of(spec.workspace, workspace)
    except PathError as error:
        yield ("workspace",), str(error)
        return
    packages = Packages.around(folder)
    yield from _launch_problems(spec.launch, packages) if spec.launch else _node_problems(spec.nodes or (), packages)


@dataclass(frozen=True, slots=True)
class Packages:
    """The packages of a workspace and of ROS; `ros` None: ROS is not installed, and may have others."""

    workspace: Path
    users: Mapping[str, Path]
    ros: Ros | None
    distributed: Mapping[str, Path]

    @classmethod
    def around(cls, workspace: Path) -> Packages:
        """Return the packages of a workspace and of the installed ROS."""
        ros, _ = local_ros()
        return cls(workspace, packages_in(workspace), ros, packages_of([ros.share]) if ros else {})

    def missing_message(self, name: str) -> str | None:
        """Return the message for a missing package; None if it exists, or cannot be checked."""
        if name in self.users or name in self.distributed or self.ros is None:
            return None
        # Suggest the user's own packages; the packages of ROS would fill a screen.
        near = did_you_mean(name, self.users or self.distributed)
        return f"there is no package '{name}' in {self.workspace} or ROS{near}"

    def folder(self, name: str) -> Path | None:
        """Return the folder of a package; None for a package of ROS that is not installed."""
        return self.users.get(name) or self.distributed.get(name)


def _launch_problems(launch: Sequence[str], packages: Packages) -> SpecProblems:
    package, name, *arguments = launch
    folder = packages.folder(package)
    if missing_message := packages.missing_message(package):
        yield ("launch", 0), missing_message
    elif folder is None:
        return
    elif (file := find_launch_file(folder, name)) is None:
        files = {path.name for path in folder.rglob("*") if path.suffix in _LAUNCH_FILES} - {"package.xml"}
        yield ("launch", 1), f"the package '{package}' has no file '{name}'{did_you_mean(name, files)}"
    else:
        for index, message in argument_problems(file, arguments):
            yield ("launch", 1 if index is None else index + 2), message


def _node_problems(nodes: Sequence[NodeSpec], packages: Packages) -> SpecProblems:
    names: set[tuple[str | None, str]] = set()
    for index, node in enumerate(nodes):
        if (node.namespace, node.called) in names:
            yield ("nodes", index), f"a second node named '{node.called}'; give each node its own 'name'"
        names.add((node.namespace, node.called))
        if (missing_message := packages.missing_message(node.package)) or (
            missing_message := program_problem(node.package, node.type, packages)
        ):
            yield ("nodes", index), missing_message


def program_problem(package: str, name: str, packages: Packages) -> str | None:
    """Return the reason why a program of a package cannot be a node; None if it can, or cannot be checked."""
    programs = dict(_programs(package, packages))
    if packages.folder(package) is None or programs.get(name):
        return None
    if name in programs:
        fix = f"run chmod +x {name} and git update-index --chmod=+x {name}"
        return f"'{name}' of '{package}' is not executable; {fix}"
    can_run = [program for program, is_executable in programs.items() if is_executable]
    near = did_you_mean(name, can_run) if can_run else ""
    return f"the package '{package}' has no node '{name}'{near}; add the file, or correct its name"


def _programs(package: str, packages: Packages) -> Iterator[tuple[str, bool]]:
    """Yield file name and "can be run" of each possible node, in the package and in the folders of a build."""
    built = [packages.workspace / space / "lib" / package for space in ("devel", "install")]
    built += [packages.ros.prefix / "lib" / package] if packages.ros else []
    folder = packages.folder(package)
    for path in [*_files(folder), *(file for place in built for file in _files(place))]:
        yield path.name, os.access(path, os.X_OK)


def _files(folder: Path | None) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file()) if folder is not None else []


def argument_problems(file: Path, arguments: Sequence[str]) -> Iterator[tuple[int | None, str]]:
    """Yield problems of launch arguments, by their index; None: of the file. roslaunch ignores misspelt names."""
    try:
        root = ET.fromstring(read_at_most(file, _MAX_LAUNCH_FILE_BYTES) or b"")  # noqa: S314 - of the user's own package
    except (OSError, ET.ParseError) as error:
        yield None, f"'{file.name}' is not a launch file: {error}"
        return
    own = dict(_own(root))
    for index, argument in enumerate(arguments):
        name = argument.partition(":=")[0]
        if problem := argument_problem(argument):
            yield index, problem
        elif name not in own:
            yield index, f"'{file.name}' has no argument '{name}'{did_you_mean(name, own)}"
        elif own[name].get("value") is not None:
            yield index, f"'{name}' has a fixed value in '{file.name}'; only an argument with a default can be set"
    stated = {argument.partition(":=")[0] for argument in arguments}
    for name, tag in own.items():
        if name not in stated and set(tag.attrib) <= {"name", "doc"}:
            yield None, f"'{file.name}' needs the argument '{name}': give it as {name}:=VALUE"


def _own(root: ET.Element) -> Iterator[tuple[str, ET.Element]]:
    handed_on = {tag for include in root.iter("include") for tag in include.iter("arg")}
    return ((name, tag) for tag in root.iter("arg") if tag not in handed_on and (name := tag.get("name")))
