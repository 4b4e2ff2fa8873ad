"""Catkin packages in folders and workspaces."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

from sim_action.core.files import read_at_most
from sim_action.core.workspace import Workspace
from sim_action.ros.launches import workspace_folder

PACKAGE_FILE: Final = "package.xml"

# Folders of builds, and others without packages of the user.
_SKIPPED_FOLDERS: Final = frozenset({"build", "devel", "install", "logs", "node_modules"})
_EXPORT_ATTRIBUTE: Final = "gazebo_model_path"
# Names without path separators and without characters that a shell or ROS would split at.
_NAME: Final = re.compile(r"[A-Za-z0-9][\w.-]*")
_MAX_PACKAGE_BYTES: Final = 1_000_000
_IGNORE_FILE: Final = "CATKIN_IGNORE"


def packages_below(folder: Path) -> Iterator[tuple[str, Path]]:
    """Yield name and folder of each package in a folder or below it, without the output of builds."""
    for parent, folders, files in os.walk(folder):
        if _IGNORE_FILE in files:
            folders.clear()
        elif PACKAGE_FILE in files:
            yield package_name(Path(parent)), Path(parent)
            folders.clear()
        folders[:] = sorted(name for name in folders if name not in _SKIPPED_FOLDERS and name[0] != ".")


def package_name(folder: Path) -> str:
    """Return the name in package.xml, else the name of the folder. The name is safe as the name of a folder.

    A package.xml that is a link out of the package is not read.
    """
    path, name = folder / PACKAGE_FILE, None
    with suppress(ET.ParseError, OSError):
        if path.resolve().is_relative_to(folder.resolve()):
            content = read_at_most(path, _MAX_PACKAGE_BYTES) or b""
            name = ET.fromstring(content).findtext("name")  # noqa: S314 - of the user's own package
    stated = (name or "").strip()
    return stated if _NAME.fullmatch(stated) else folder.name.strip()


def packages_of(paths: Iterable[Path | str]) -> dict[str, Path]:
    """Return name -> folder of the packages that are these folders or right below them; the first of a name counts."""
    found: dict[str, Path] = {}
    for path in map(Path, paths):
        for package in sorted([path / PACKAGE_FILE, *path.glob(f"*/{PACKAGE_FILE}")]):
            if package.is_file():
                found.setdefault(package.parent.name, package.parent)
    return found


def find_launch_file(package: Path, name: str) -> Path | None:
    """Return a launch file of a package: by its path in the package, else by its name in any subfolder."""
    named = [package / name, *sorted(package.rglob(Path(name).name))]
    found = (path for path in named if path.is_file() and path.resolve().is_relative_to(package.resolve()))
    return next(found, None)


def sources(workspace: Path) -> Path:
    """Return the folder of the packages of a workspace: its `src`, if there is one."""
    below = workspace / "src"
    return below if below.is_dir() and not (workspace / PACKAGE_FILE).exists() else workspace


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
    """Return the catkin workspace of a scenario.

    It is the folder `stated`, else the nearest one around the scenario with packages in its `src`, else the root.
    Raises PathError.
    """
    return workspace_folder(stated, workspace, _is_catkin)


def packages_in(workspace: Path) -> dict[str, Path]:
    """Return name -> folder of the packages in a workspace."""
    return dict(packages_below(sources(workspace)))


def _is_catkin(folder: Path) -> bool:
    return not (folder / PACKAGE_FILE).exists() and any(True for _ in packages_below(folder / "src"))
