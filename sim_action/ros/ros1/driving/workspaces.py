"""Which catkin workspace a scenario's nodes are of, and which packages there are in it."""

from __future__ import annotations

from pathlib import Path

from sim_action.core.workspace import PathError, Workspace
from sim_action.ros.ros1.catkin_packages import PACKAGE_FILE, packages_below, sources


def workspace_of(stated: str | None, workspace: Workspace) -> Path:
    """The folder that is named; else the nearest one around the scenario with packages in its `src`; else the root.

    Raises PathError.
    """
    if stated is not None:
        found = workspace.file_or_folder(stated)
        if not found.is_dir():
            raise PathError(f"'{stated}' is no folder (looked for {found})")
        return found
    around = (folder for folder in (workspace.directory, *workspace.directory.parents) if _is_inside(folder, workspace))
    return next(filter(_is_catkin, around), workspace.root)


def packages_in(workspace: Path) -> dict[str, Path]:
    """Name -> folder."""
    return dict(packages_below(sources(workspace)))


def _is_inside(folder: Path, workspace: Workspace) -> bool:
    return folder.is_relative_to(workspace.root)


def _is_catkin(folder: Path) -> bool:
    """Packages have a `src`, too, with their code."""
    return not (folder / PACKAGE_FILE).exists() and any(True for _ in packages_below(folder / "src"))
