"""Packages and models in the folders that whoever owns the machine named: ROS_PACKAGE_PATH and its like."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Final

from sim_action.robot.package_folders import PACKAGE_FILE, PackageFolders, folders_below, is_model

PACKAGE_VARIABLES: Final = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")
MODEL_VARIABLES: Final = ("GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH")


@dataclass(frozen=True)
class OwnersFolders:
    """What the variables of an environment lead to; read when it is first asked for, and kept."""

    environment: Mapping[str, str] = field(repr=False)

    def package(self, name: str) -> Path | None:
        """A package's folder; the first of several, as in ROS."""
        below = (found.packages[name][0] for found in self._packages if name in found.packages)
        return next(below, None) or next(_children(self._shares, name), None)

    def model(self, name: str) -> Path | None:
        """A Gazebo model's folder."""
        return next((folder for folder in _children(self._model_path, name) if is_model(folder)), None)

    def hold(self, path: Path) -> bool:
        """Whether a path, its links resolved, is in one of these packages and models."""
        for folder in (path, *path.parents):
            if folder.parent in self._shares:
                return True
            if (folder / PACKAGE_FILE).is_file() and _is_below(folder, self._package_path):
                return True
            if is_model(folder) and _is_below(folder, self._model_path):
                return True
        return False

    @property
    def package_names(self) -> set[str]:
        """Of those below ROS_PACKAGE_PATH."""
        return {name for found in self._packages for name in found.packages}

    def described(self, variables: Iterable[str]) -> tuple[str, ...]:
        """Such as "ROS_PACKAGE_PATH (not set)"."""
        return tuple(f"{variable} ({self.environment.get(variable) or 'not set'})" for variable in variables)

    @cached_property
    def _packages(self) -> tuple[PackageFolders, ...]:
        """Of ROS_PACKAGE_PATH, entry by entry; as in ROS, no package is looked for below another."""
        return tuple(folders_below(entry, inside_packages=False) for entry in self._package_path)

    @cached_property
    def _package_path(self) -> tuple[Path, ...]:
        return self._entries("ROS_PACKAGE_PATH")

    @cached_property
    def _shares(self) -> tuple[Path, ...]:
        return tuple(prefix / "share" for prefix in self._entries("AMENT_PREFIX_PATH"))

    @cached_property
    def _model_path(self) -> tuple[Path, ...]:
        return tuple(entry for variable in MODEL_VARIABLES for entry in self._entries(variable))

    def _entries(self, variable: str) -> tuple[Path, ...]:
        """A relative one is left out: it would be another folder for every working directory."""
        paths = map(Path, self.environment.get(variable, "").split(os.pathsep))
        return tuple(path.resolve() for path in paths if path.is_absolute())


def _children(parents: Iterable[Path], name: str) -> Iterator[Path]:
    if "/" in name or "\0" in name or name in ("", ".", ".."):
        return iter(())
    return (folder for parent in parents if (folder := parent / name).is_dir())


def _is_below(folder: Path, entries: Iterable[Path]) -> bool:
    return any(folder.is_relative_to(entry) for entry in entries)
