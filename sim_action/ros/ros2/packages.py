"""The packages of a ROS 2 workspace, installed by colcon or as sources, and their executables.

A package of build type ament_python needs no build: its entry points are read, and an overlay with a program for each
stands for its installation. All other packages must be installed (`colcon build`).
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

from sim_action.core.records import dataclass
from sim_action.core.workspace import PathError, Workspace
from sim_action.robot.documents.package_search import PACKAGE_FILE, folders_below
from sim_action.ros.ros2.environment_hooks import packages_of_prefix, set_up
from sim_action.ros.ros2.installation import Ros2
from sim_action.ros.ros2.python_packages import PythonPackage, read_package

INSTALL: Final = "install"
_SOURCES: Final = "src"
_LAYOUT_FILE: Final = ".colcon_install_layout"
_INDEX: Final = "share/ament_index/resource_index/packages"
_LAUNCH_SUFFIXES: Final = (".py", ".xml", ".yaml", ".yml", ".launch")
_MAX_FIRST_LINE_BYTES: Final = 300
_OVERLAY: Final = "overlay"


def workspace_of(stated: str | None, workspace: Workspace) -> Path:
    """Return the ROS 2 workspace of a scenario.

    It is the folder `stated`: a workspace, an install folder or prefix, or any folder with packages. Otherwise it is
    the nearest folder around the scenario with an install folder or with packages in its `src`, else the root.
    Raise PathError.
    """
    if stated is not None:
        found = workspace.file_or_folder(stated)
        if not found.is_dir():
            raise PathError(f"'{stated}' is not a folder (looked for {found})")
        return found
    directory = workspace.directory
    around = (folder for folder in (directory, *directory.parents) if folder.is_relative_to(workspace.root))
    return next(filter(_is_workspace, around), workspace.root)


@dataclass(frozen=True, slots=True)
class Packages:
    """The packages of a workspace and of ROS 2.

    Attributes:
        workspace: the folder that was searched.
        installed: name -> install prefix of the packages that are built.
        sources: name -> the other packages.
        ros: the installation; None: ROS 2 is not installed, and may have other packages.
        distributed: name -> prefix of the packages of the installation.
    """

    workspace: Path
    installed: Mapping[str, Path]
    sources: Mapping[str, PythonPackage]
    ros: Ros2 | None
    distributed: Mapping[str, Path]

    @classmethod
    def around(cls, workspace: Path, ros: Ros2 | None) -> Packages:
        """Return the packages of a workspace and of an installation."""
        prefixes = prefixes_in(workspace)
        installed = _by_name(prefixes)
        folders = _source_folders(workspace)
        sources = {name: read_package(name, folder) for name, folder in folders.items() if name not in installed}
        return cls(workspace, installed, sources, ros, _by_name(ros.prefixes) if ros else {})

    @property
    def names(self) -> set[str]:
        """The names of the user's packages, or of all packages if the user has none."""
        return {*self.installed, *self.sources} or set(self.distributed)

    def prefix(self, name: str) -> Path | None:
        """Return the prefix where a package is installed; None: it is not."""
        return self.installed.get(name) or self.distributed.get(name)

    def executables(self, name: str) -> dict[str, Path | None]:
        """Return the programs of a package by their names; None: the program is an entry point of a package in source.

        Files that cannot be run are included.
        """
        source = self.sources.get(name)
        if source is not None:
            return {**dict.fromkeys(source.entry_points), **{path.name: path for path in source.scripts}}
        prefix = self.prefix(name)
        return {path.name: path for path in _files(prefix / "lib" / name)} if prefix else {}

    def launch_files(self, name: str) -> dict[str, Path]:
        """Return the launch files of a package by their names."""
        source, prefix = self.sources.get(name), self.prefix(name)
        share = source.folder if source else prefix and prefix / "share" / name
        if share is None:
            return {}
        files = (path for path in _files(share) if path.suffix in _LAUNCH_SUFFIXES)
        return {path.name: path for path in files if "launch" in path.name or path.parent.name == "launch"}

    def set_up(self, folder: Path) -> dict[str, str]:
        """Return the environment variables of all processes, and write the overlay into an empty folder.

        Needs an installation.
        """
        assert self.ros is not None
        overlay = folder / _OVERLAY
        python = [package for package in self.sources.values() if package.is_python]
        for package in python:
            _install(package, overlay, self.ros.python)
        before = {**os.environ, **self.ros.variables}
        prefixes = (*([overlay] if python else []), *dict.fromkeys(self.installed.values()))
        variables = {**self.ros.variables, **set_up(prefixes, before).variables}
        modules = [str(package.modules) for package in python]
        paths = [path for path in variables.get("PYTHONPATH", "").split(os.pathsep) if path]
        return {**variables, "PYTHONPATH": os.pathsep.join(dict.fromkeys([*modules, *paths]))}

    def command(self, package: str, executable: str, folder: Path) -> list[str]:
        """Return the command of a program; `folder`: the one of `set_up`. Raise PathError if it does not exist."""
        assert self.ros is not None
        path = self.executables(package).get(executable, Path())
        if path is None:
            return [str(self.ros.python), str(folder / _OVERLAY / "lib" / package / executable)]
        if not path.is_file():
            raise PathError(f"the executable '{package}/{executable}' does not exist any more")
        return command_of(path, self.ros.python)


def command_of(program: Path, python: Path) -> list[str]:
    """Return the command that runs a program: programs in Python are run by the Python of ROS 2."""
    return [str(python), str(program)] if is_python(program) else [str(program)]


def is_python(program: Path) -> bool:
    """Return True for a program in Python: by its suffix, or the interpreter of its first line."""
    if program.suffix == ".py":
        return True
    try:
        with program.open("rb") as file:
            first = file.readline(_MAX_FIRST_LINE_BYTES)
    except OSError:
        return False
    return first.startswith(b"#!") and any(word.rpartition(b"/")[2].startswith(b"python") for word in first.split())


def prefixes_in(folder: Path) -> tuple[Path, ...]:
    """Return the install prefixes of a workspace: its install folder, or one for each package in it."""
    install = folder if _is_install(folder) else folder / INSTALL
    if not _is_install(install):
        return ()
    isolated = [path for path in _folders(install) if (path / "share" / path.name / PACKAGE_FILE).is_file()]
    merged = [install] if packages_of_prefix(install) else []
    return (*merged, *isolated)


def _is_install(folder: Path) -> bool:
    return (folder / _LAYOUT_FILE).is_file() or (folder / _INDEX).is_dir()


def _is_workspace(folder: Path) -> bool:
    if (folder / PACKAGE_FILE).exists():
        # A package may have a folder `src`, too, with its code.
        return False
    return _is_install(folder / INSTALL) or bool(_found_below(folder / _SOURCES))


def _source_folders(workspace: Path) -> dict[str, Path]:
    """Return name -> folder of the packages in source; next to an install folder, they are in `src`."""
    if _is_install(workspace):
        return _found_below(workspace.parent / _SOURCES)
    below = workspace / _SOURCES
    return _found_below(below if below.is_dir() and not (workspace / PACKAGE_FILE).exists() else workspace)


def _found_below(folder: Path) -> dict[str, Path]:
    if not folder.is_dir():
        return {}
    found = folders_below(folder, inside_packages=False).packages
    return {name: folders[0] for name, folders in found.items()}


def _by_name(prefixes: Sequence[Path]) -> dict[str, Path]:
    found: dict[str, Path] = {}
    for prefix in prefixes:
        for name in packages_of_prefix(prefix):
            found.setdefault(name, prefix)
    return found


def _install(package: PythonPackage, prefix: Path, python: Path) -> None:
    """Write what `colcon build --symlink-install` would install of a package, except its modules."""
    programs, share, index = prefix / "lib" / package.name, prefix / "share", prefix / _INDEX
    for folder in (programs, share, index):
        folder.mkdir(parents=True, exist_ok=True)
    (index / package.name).touch()
    (share / package.name).symlink_to(package.folder)
    for name, entry in package.entry_points.items():
        module, _, function = entry.partition(":")
        first = function.partition(".")[0]
        text = (
            f"import sys\n\nfrom {module} import {first}\n\nsys.exit({function}())\n" if first else f"import {module}\n"
        )
        _write_program(programs / name, python, text)
    for script in package.scripts:
        (programs / script.name).symlink_to(script)


def _write_program(path: Path, python: Path, text: str) -> None:
    # A first line with the path of Python would be limited in length and could have no blanks.
    path.write_text(f"#!/bin/sh\n'''exec' \"{python}\" \"$0\" \"$@\"\n' '''\n{text}", encoding="utf-8")
    path.chmod(0o755)


def _folders(folder: Path) -> list[Path]:
    try:
        return sorted(path for path in folder.iterdir() if path.is_dir())
    except OSError:
        return []


def _files(folder: Path) -> Iterator[Path]:
    return (path for path in sorted(folder.rglob("*")) if path.is_file() and "__pycache__" not in path.parts)
