"""Catkin packages in folders and workspaces."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

from sim_action.core.workspace import Workspace
from sim_action.robot.documents.package_search import PACKAGE_FILE, folders_below
from sim_action.ros.launches import source_folder, workspace_folder

_EXPORT_ATTRIBUTE: Final = "gazebo_model_path"
# Names without path separators and without characters that a shell or ROS would split at.
_NAME: Final = re.compile(r"[A-Za-z0-9][\w.-]*")


def packages_below(folder: Path) -> dict[str, Path]:
    """Return name -> folder of the packages in a folder and below it, without the output of builds.

    A package whose name is no valid folder name is named after its folder; the first package of a name counts.
    """
    packages: dict[str, Path] = {}
    for name, folders in folders_below(folder, inside_packages=False).packages.items():
        for package in folders:
            packages.setdefault(name if _NAME.fullmatch(name) else package.name.strip(), package)
    return packages


def packages_of(paths: Iterable[Path | str]) -> dict[str, Path]:
    """Return name -> folder of the packages that are these folders or right below them; the first of a name counts."""
    packages: dict[str, Path] = {}
    for path in map(Path, paths):
        for package in sorted([path / PACKAGE_FILE, *path.glob(f"*/{PACKAGE_FILE}")]):
            if package.is_file():
                packages.setdefault(package.parent.name, package.parent)
    return packages


def find_launch_file(package: Path, name: str) -> Path | None:
    """Return a launch file of a package: by its path in the package, else by its name in any subfolder."""
    named = [package / name, *sorted(package.rglob(Path(name).name))]
    files = (path for path in named if path.is_file() and path.resolve().is_relative_to(package.resolve()))
    return next(files, None)


def exported_models(packages: Iterable[Path]) -> Iterator[str]:
    """Yield the model folders that packages export: `<export><gazebo_ros gazebo_model_path="${prefix}/models"/>`."""
    for package in packages:
        text = (package / PACKAGE_FILE).read_text(encoding="utf-8", errors="replace")
        if _EXPORT_ATTRIBUTE not in text:
            continue
        try:
            exports = ET.fromstring(text.encode()).findall("export/gazebo_ros")  # noqa: S314 - of packages of ROS
        except ET.ParseError:
            continue
        stated = (export.get(_EXPORT_ATTRIBUTE, "").replace("${prefix}", str(package)) for export in exports)
        yield from (folder for paths in stated for folder in paths.split(os.pathsep) if folder)


def workspace_of(stated: str | None, workspace: Workspace) -> Path:
    """Return `stated`, else the nearest folder with packages in its `src`, else the root. Raises PathError."""
    return workspace_folder(stated, workspace, lambda folder: bool(packages_below(folder / "src")))


def packages_in(workspace: Path) -> dict[str, Path]:
    """Return name -> folder of the packages in a workspace."""
    return packages_below(source_folder(workspace))
