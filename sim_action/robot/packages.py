"""Find ROS packages and Gazebo models by name, without ROS: `package://`, `model://`, `file://` -> files.

The search order is: the packages that the caller provides, `robot.packages` of the scenario, the package of the
referring file, the workspace, ROS_PACKAGE_PATH, AMENT_PREFIX_PATH (models: GAZEBO_MODEL_PATH, GZ_SIM_RESOURCE_PATH).

A file must lie in the workspace, or in a package or model on one of those paths, because only the owner of the machine
can set them. Links are resolved first, so that a link cannot lead out of a package.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice
from pathlib import Path, PureWindowsPath
from typing import Final
from urllib.parse import unquote

from sim_action.core.wording import FirstFew, nearest
from sim_action.core.workspace import OUTSIDE_REMEDY, Workspace, path_problem
from sim_action.robot.package_search import (
    MODEL_VARIABLES,
    PACKAGE_FILE,
    PACKAGE_VARIABLES,
    EnvironmentFolders,
    PackageFolders,
    folders_below,
    is_model,
    package_name,
)
from sim_action.robot.xml_document import ModelDocument, read_document

_PLACES_SHOWN: Final = 5
_NAMES_READ: Final = 10_000

Version = tuple[int, int]

NEWEST: Final[Version] = (1, 11)
"""The newest version of SDF that is supported; a newer file is read as this version."""

_MANIFEST: Final = "model.config"

_MODEL: Final = "model.sdf"


class PackageError(Exception):
    """A reference that names no usable file.

    `rule` is missing-package, missing-file, outside-workspace or bad-reference.
    """

    def __init__(self, rule: str, message: str) -> None:
        self.rule = rule
        super().__init__(message)


@dataclass(frozen=True, slots=True)
class Found:
    """The file or folder that a reference names; `warning`: a note for the user, such as a second package."""

    path: Path
    warning: str | None = None


@dataclass(frozen=True)
class Packages:
    """The packages that one scenario can use. The search of the workspace is cached: create one object per scenario.

    Attributes:
        workspace: the workspace of the scenario.
        mapped: `robot.packages`: name -> folder, relative to the scenario.
        environment: environment variables; only those named above are read.
    """

    workspace: Workspace
    mapped: Mapping[str, str] = field(default_factory=dict)
    environment: Mapping[str, str] = field(default_factory=lambda: dict(os.environ), repr=False)
    _hinted: FirstFew = field(default_factory=FirstFew, init=False, repr=False, compare=False)

    def find(self, name: str, referrer: Path) -> Found:
        """Return the folder of a package; `referrer` is the file that names it. Raises PackageError."""
        here = referrer.resolve()
        found = self._package(name, here)
        if found is None:
            raise self._missing("package", name, here, PACKAGE_VARIABLES)
        return found

    def find_model(self, name: str, referrer: Path) -> Found:
        """Return the folder of a Gazebo model, or of a package with that name. Raises PackageError."""
        here = referrer.resolve()
        found = (
            self._given(name)
            or self._mapped(name)
            or _nearest(self._inside.models.get(name), here)
            or _of(self._environment_folders.model(name))
        )
        found = found or self._package(name, here)
        if found is None:
            raise self._missing("model", name, here, (*MODEL_VARIABLES, *PACKAGE_VARIABLES))
        return found

    def resolve(self, reference: str, referrer: Path) -> Found:
        """Return the file that `reference`, written in `referrer`, names. Raises PackageError."""
        scheme, separator, rest = reference.partition("://")
        if not separator:
            _refuse_one_slash(reference)
            return Found(self.file(referrer.resolve().parent / reference, reference))
        if scheme == "file":
            return Found(self.file(_path_of_address(rest, reference), reference))
        finders: dict[str, Callable[[str, Path], Found]] = {"package": self.find, "model": self.find_model}
        if scheme not in finders:
            allowed = "package://name/path, model://name/path, file:///path, or a path relative to the referring file"
            raise PackageError("bad-reference", f"'{reference}' is not a valid reference; allowed are {allowed}")
        name, _, path = rest.partition("/")
        if not name or not path:
            raise PackageError("bad-reference", f"'{reference}' names no file; write {scheme}://name/path/of/the/file")
        folder = finders[scheme](name, referrer)
        return Found(self.file(folder.path / path, reference), folder.warning)

    def may_read(self, path: Path) -> bool:
        """Return True if a file or folder may be read; links in `path` must be resolved."""
        if path.is_relative_to(self.workspace.root):
            return self.workspace.refusal(path) is None
        return self.workspace.refusal(path) is None or self._environment_folders.contains(path)

    def file(self, path: Path, reference: str) -> Path:
        """Return the file at an absolute path; `reference` is its text in the referring file. Raises PackageError."""
        found = self.place(path, reference)
        is_file, is_folder, is_there = found.is_file(), found.is_dir(), found.exists()
        if is_there and not is_file and not is_folder:
            raise PackageError("missing-file", f"'{reference}' is not a regular file (looked for {found})")
        if not is_file:
            reason = "is a folder" if is_folder else "does not exist"
            raise PackageError(
                "missing-file", f"'{reference}' {reason} (looked for {found}){self._similar_name(found)}"
            )
        return found

    def place(self, path: Path, reference: str) -> Path:
        """Return the absolute path of a file that may be read, with its links resolved; it may be missing.

        Raises PackageError.
        """
        try:
            found = path.resolve()
            # %20 means a space, as in a URL, if no file has the literal name.
            if not found.exists() and "%" in reference:
                found = Path(unquote(str(path))).resolve()
                found.exists()
        except (OSError, ValueError, RuntimeError) as error:  # too long, contains a NUL, or a loop of links
            raise PackageError("bad-reference", f"{reference!r} is not a valid path: {path_problem(error)}") from None
        if not self.may_read(found):
            portable = "; better: a path relative to the referring file, or package://, works on every machine"
            is_absolute = reference.startswith(("/", "file:"))
            raise self._outside(f"'{reference}'", found, portable if is_absolute else "")
        return found

    def _package(self, name: str, here: Path) -> Found | None:
        found = self._given(name) or self._mapped(name)
        found = found or self._above(name, here) or _nearest(self._inside.packages.get(name), here)
        return found or _of(self._environment_folders.package(name))

    def _given(self, name: str) -> Found | None:
        """Return the folder of a package that the caller provides."""
        return _of(next((Path(folder) for given, folder in self.workspace.packages if given == name), None))

    def _mapped(self, name: str) -> Found | None:
        if name not in self.mapped:
            return None
        what = f"'{name}: {self.mapped[name]}' in robot.packages"
        try:
            folder = (self.workspace.directory / self.mapped[name]).resolve()
            is_folder = folder.is_dir()
        except (OSError, ValueError, RuntimeError) as error:
            problem = path_problem(error, "folder")
            raise PackageError("missing-package", f"{what} is not a valid path: {problem}") from None
        if not self.may_read(folder):
            raise self._outside(what, folder)
        if not is_folder:
            raise PackageError("missing-package", f"{what} is not a folder (looked for {folder})")
        return Found(folder)

    def _above(self, name: str, here: Path) -> Found | None:
        """Return the package of the referring file, if it has this name: it comes before others of the same name."""
        for folder in here.parents:
            if not self.may_read(folder):
                return None
            manifest = folder / PACKAGE_FILE
            if manifest.is_file() and self.may_read(manifest.resolve()) and package_name(folder) == name:
                return Found(folder)
        return None

    @cached_property
    def _inside(self) -> PackageFolders:
        return folders_below(self.workspace.root, inside_packages=True)

    @cached_property
    def _environment_folders(self) -> EnvironmentFolders:
        return EnvironmentFolders(self.environment)

    def _outside(self, what: str, found: Path, advice: str = "") -> PackageError:
        where = f"{self.workspace.refusal(found)} (it is {found})"
        lifted = "name another file" if found.is_relative_to(self.workspace.root) else OUTSIDE_REMEDY
        return PackageError("outside-workspace", f"{what} {where}; {lifted}{advice}")

    def _missing(self, kind: str, name: str, here: Path, variables: Iterable[str]) -> PackageError:
        inside, root = self._inside, self.workspace.root
        known = {
            *self.mapped,
            *(given for given, _ in self.workspace.packages),
            *inside.packages,
            *self._environment_folders.package_names,
            *(inside.models if kind == "model" else ()),
        }
        near = nearest(name, sorted(known)) if self._hinted.one_more() else None
        hint = "" if near is None else f"; did you mean '{near}'?"
        extent = (
            f"{len(inside.packages)} packages" if inside.complete else "only some of its folders: there are too many"
        )
        places = ("robot.packages", f"{root} ({extent})", *self._environment_folders.described(variables))
        where = here.relative_to(root) if here.is_relative_to(root) else here
        return PackageError(
            "missing-package",
            f"{where} refers to the {kind} '{name}', which was not found{hint} (searched: {', '.join(places)}); "
            f"add it to the repository, or set its folder: robot.packages: {{{name}: path/to/{name}}}, or "
            f"name a folder outside the repository: --package {name}=FOLDER",
        )

    def _similar_name(self, path: Path) -> str:
        """Return a hint with a similar name in the same folder: exporters confuse Base.STL and base.stl."""
        if not self._hinted.one_more():
            return ""
        try:
            with os.scandir(path.parent) as entries:
                names = {entry.name.lower(): entry.name for entry in islice(entries, _NAMES_READ)}
        except OSError:
            return ""
        near = nearest(path.name.lower(), sorted(names))
        return "" if near is None else f"; did you mean '{names[near]}'?"


def _of(folder: Path | None) -> Found | None:
    return None if folder is None else Found(folder)


def _nearest(folders: tuple[Path, ...] | None, here: Path) -> Found | None:
    """Return the folder with the shortest path from the referring file, with a warning if there are several."""
    if folders is None:
        return None
    nearest, *others = sorted(folders, key=lambda folder: (_steps(here.parent, folder), folder))
    if not others:
        return Found(nearest)
    passed_over = ", ".join(map(str, others[:_PLACES_SHOWN])) + ("" if len(others) <= _PLACES_SHOWN else ", ...")
    chosen = f"{nearest} is used, because it is nearest to {here.name}, not {passed_over}"
    return Found(nearest, f"{len(folders)} packages have the same name: {chosen}; set robot.packages to choose one")


def _steps(start: Path, end: Path) -> int:
    """Return the number of folders on the path from one to the other."""
    common = len(Path(os.path.commonpath((start, end))).parts)
    return len(start.parts) + len(end.parts) - 2 * common


def _refuse_one_slash(reference: str) -> None:
    """Raise PackageError for a reference such as package:/name, which would look like a path."""
    scheme, _, rest = reference.partition(":/")
    if scheme in {"package", "model", "file"} and rest:
        meant = f"{scheme}://{'/' if scheme == 'file' else ''}{rest}"
        raise PackageError("bad-reference", f"'{reference}' lacks a slash; did you mean '{meant}'?")


def _path_of_address(rest: str, reference: str) -> Path:
    path = rest.removeprefix("localhost")
    if not path.startswith("/"):
        meant = f"write file:///{rest}, or '{rest}' for a path relative to the referring file"
        raise PackageError("bad-reference", f"'{reference}': file:// needs an absolute path; {meant}")
    # The path of file:///C:/robot.stl starts with a slash, too.
    is_on_drive = sys.platform == "win32" and PureWindowsPath(path[1:]).drive
    return Path(path[1:] if is_on_drive else path)


def find_model_file(
    reference: str, referrer: Path, packages: Packages, read: Callable[[Path], ModelDocument] = read_document
) -> Found:
    """Return the file of a model that an address, a path, or a folder of a Gazebo model names. Raises PackageError.

    :param read: reads a model.config.
    """
    scheme, separator, rest = reference.partition("://")
    warning = None
    name, _, path = rest.partition("/")
    if not separator:
        place = referrer.resolve().parent / reference
        if "/" not in reference and not place.suffix and not _is_folder(place):
            # A bare name is a model's name, as in SDF_PATH.
            return find_model_file(f"model://{reference}", referrer, packages, read)
    elif name and scheme in {"model", "package"}:
        found = (packages.find_model if scheme == "model" else packages.find)(name, referrer)
        place, warning = found.path / path, found.warning
    else:
        return packages.resolve(reference, referrer)
    if not _is_folder(place):
        return Found(packages.file(place, reference), warning)
    return Found(_file_in(place.resolve(), reference, packages, read), warning)


def is_model_folder(path: Path) -> bool:
    """Return True if a folder contains a model.config or a model.sdf."""
    return _is_folder(path) and is_model(path)


def parsed_version(text: str) -> Version:
    """Return the version of SDF in a text such as "1.9"; (0, 0) if it is not a version."""
    match = re.fullmatch(r"\s*([0-9]{1,4})\.([0-9]{1,4})\s*", text)
    return (int(match[1]), int(match[2])) if match else (0, 0)


def _file_in(folder: Path, reference: str, packages: Packages, read: Callable[[Path], ModelDocument]) -> Path:
    """Return the newest supported file that model.config names, or model.sdf."""
    try:
        manifest = packages.file(folder / _MANIFEST, reference)
    except PackageError:
        return packages.file(folder / _MODEL, f"{reference}/{_MODEL}")
    files = read(manifest).root.findall("sdf")
    if not files:
        raise PackageError("missing-file", f"{manifest} has no <sdf> element, which names the model's file")
    known = [file for file in files if parsed_version(file.get("version", "")) <= NEWEST]
    best = max(known or files, key=lambda file: parsed_version(file.get("version", "")))
    name = (best.text or "").strip()
    return packages.file(folder / name, f"{reference}/{name}")


def _is_folder(path: Path) -> bool:
    """Return True if a path is a folder, for any text as path."""
    try:
        return path.is_dir()
    except (OSError, ValueError, RuntimeError):
        return False
