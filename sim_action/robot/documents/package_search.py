"""Search folders for ROS packages and Gazebo models, without ROS.

`folders_below` searches a workspace by package.xml and model.config. `EnvironmentFolders` searches the paths in
ROS_PACKAGE_PATH, AMENT_PREFIX_PATH, GAZEBO_MODEL_PATH and GZ_SIM_RESOURCE_PATH. `Listings` finds a file although the
model spells its name differently, as Windows and macOS do: letter case, backslashes.
"""

from __future__ import annotations

import os
from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property
from itertools import islice
from pathlib import Path, PurePosixPath
from typing import Final
from xml.parsers import expat

from sim_action.core.files import read_at_most
from sim_action.core.records import dataclass, field
from sim_action.core.workspace import is_of_git

PACKAGE_FILE: Final = "package.xml"
_MODEL_FILES: Final = frozenset({"model.config", "model.sdf"})
_IGNORE_FILES: Final = frozenset({"CATKIN_IGNORE", "COLCON_IGNORE", "AMENT_IGNORE"})
# Folders that catkin, colcon and other tools generate: copies of packages, or no packages.
_SKIPPED: Final = frozenset({"build", "devel", "install", "log", "logs", "node_modules", "__pycache__"})
_MAX_FOLDERS: Final = 20_000
_MAX_DEPTH: Final = 16
_MAX_PACKAGE_BYTES: Final = 1_000_000
_MAX_NAME_BYTES: Final = 255
_MAX_LISTED: Final = 10_000
PACKAGE_VARIABLES: Final = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")

# Gazebo also finds model://part.dae, a file directly on the path for models.
_MESHES: Final = frozenset({".dae", ".obj", ".stl"})
MODEL_VARIABLES: Final = ("GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH")


@dataclass(frozen=True, slots=True)
class PackageFolders:
    """The packages and models below a folder."""

    # name -> its folders, nearest to the root first; several packages may have the same name
    packages: Mapping[str, tuple[Path, ...]]
    models: Mapping[str, tuple[Path, ...]]  # the same for Gazebo models; the name is the name of the folder
    # the same for all folders without a package.xml; empty outside of the workspace
    folders: Mapping[str, tuple[Path, ...]]
    complete: bool  # True if all folders were searched


def folders_below(root: Path, *, inside_packages: bool, follows_links: bool = False) -> PackageFolders:
    """Return the packages and models in and below a folder; `follows_links`: also read files outside of `root`."""
    packages, models, named = (defaultdict[str, list[Path]](list) for _ in range(3))
    walk = _Walk(root, inside_packages)
    names = PackageNames()
    own = root.resolve()
    for folder, files in walk.folders():
        if PACKAGE_FILE in files:
            is_own = follows_links or _is_in(folder / PACKAGE_FILE, own)
            name = names.of(folder) if is_own else folder.name
            packages[name].append(folder)
        if files & _MODEL_FILES:
            models[folder.name].append(folder)
        if inside_packages and PACKAGE_FILE not in files:
            named[folder.name].append(folder)
    return PackageFolders(_fixed(packages), _fixed(models), _fixed(named), walk.complete)


def _is_in(path: Path, root: Path) -> bool:
    try:
        file = path.resolve()
    except (OSError, RuntimeError):  # a loop of links
        return False
    return file.is_relative_to(root) and not is_of_git(file.relative_to(root))


def _fixed(names: Mapping[str, list[Path]]) -> Mapping[str, tuple[Path, ...]]:
    return {name: tuple(folders) for name, folders in names.items()}


@dataclass(slots=True)
class _Walk:
    """A walk over folders, breadth first, so that a limit leaves out the deepest folders."""

    root: Path
    inside_packages: bool
    complete: bool = True
    _waiting: deque[tuple[Path, int]] = field(default_factory=deque)

    def folders(self) -> Iterator[tuple[Path, frozenset[str]]]:
        """Yield each folder with the names of its files."""
        self._waiting.append((self.root, 0))
        count = 0
        while self._waiting:
            count += 1
            if count > _MAX_FOLDERS:
                self.complete = False
                return
            folder, depth = self._waiting.popleft()
            files, below = _listed(folder)
            if files & _IGNORE_FILES:
                continue
            yield folder, files
            if PACKAGE_FILE not in files or self.inside_packages:
                self._queue(below, depth + 1)

    def _queue(self, folders: list[Path], depth: int) -> None:
        if depth > _MAX_DEPTH:
            self.complete = self.complete and not folders
            return
        self._waiting.extend((folder, depth) for folder in folders)


def _listed(folder: Path) -> tuple[frozenset[str], list[Path]]:
    """Return the names of the files and the folders to search. Links to folders are not followed."""
    files, below = [], []
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                if not _is_folder(entry):
                    files.append(entry.name)
                elif not (entry.is_symlink() or entry.name.startswith(".") or entry.name in _SKIPPED):
                    below.append(entry.name)
    except OSError:  # no permission
        return frozenset(), []
    return frozenset(files), [folder / name for name in sorted(below)]


def _is_folder(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir()
    except OSError:  # a loop of links
        return False


def by_distance(folders: Iterable[Path], referrer: Path) -> list[Path]:
    """Return folders in the order of their distance from the referring file."""
    return sorted(folders, key=lambda folder: (_steps(referrer.parent, folder), folder))


def _steps(start: Path, end: Path) -> int:
    common = len(Path(os.path.commonpath((start, end))).parts)
    return len(start.parts) + len(end.parts) - 2 * common


def folders_named(name: str, parents: Iterable[Path]) -> Iterator[Path]:
    """Yield the folders with a name in other folders, without packages and links."""
    for folder in _children(parents, name):
        if not folder.is_symlink() and not (folder / PACKAGE_FILE).is_file():
            yield folder


def package_name(folder: Path) -> str:
    """Return the name in a package's package.xml; the name of the folder if it cannot be read."""
    return _stated_name(folder / PACKAGE_FILE) or folder.name


def _stated_name(file: Path) -> str:
    """Return the name in a package.xml; empty if it cannot be read."""
    try:
        data = read_at_most(file, _MAX_PACKAGE_BYTES)
    except OSError:
        return ""
    return _name_in(data) if data else ""


class PackageNames:
    """The names of packages; each package.xml is read once, also if several folders have a link to it."""

    def __init__(self) -> None:
        self._names: dict[Path, str] = {}

    def of(self, folder: Path) -> str:
        """Return the name in a package's package.xml; the name of the folder if it cannot be read."""
        try:
            file = (folder / PACKAGE_FILE).resolve()
        except (OSError, RuntimeError):  # a loop of links
            return folder.name
        if file not in self._names:
            self._names[file] = _stated_name(file)
        return self._names[file] or folder.name


def is_model(folder: Path) -> bool:
    """Return True if a folder is a Gazebo model."""
    return any((folder / name).is_file() for name in _MODEL_FILES)


class _DoctypeFound(Exception):
    """The file has a DOCTYPE, whose entities can expand without bound."""


def _name_in(data: bytes) -> str:
    """Return the text of <package><name>; empty if it cannot be read."""
    parser = expat.ParserCreate()
    opened = list[str]()
    texts = list[str]()

    def add(text: str) -> None:
        if opened == ["package", "name"]:
            texts.append(text)

    def refuse(*_: object) -> None:
        raise _DoctypeFound

    parser.StartElementHandler = lambda tag, _: opened.append(tag)
    parser.EndElementHandler = lambda _: opened.pop()
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = add, refuse
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, LookupError, ValueError, _DoctypeFound):
        return ""
    return "".join(texts).strip()


@dataclass(frozen=True)
class EnvironmentFolders:
    """The packages and models in the folders that environment variables name; searched once, at the first use."""

    environment: Mapping[str, str] = field(repr=False)

    def package(self, name: str) -> Path | None:
        """Return the folder of a package, the first of several as in ROS; None if there is none."""
        below = (tree.packages[name][0] for tree in self._packages if name in tree.packages)
        return next(below, None) or next(_children(self._shares, name), None)

    def model(self, name: str) -> Path | None:
        """Return the folder of a Gazebo model; None if there is none."""
        return next((folder for folder in _children(self.model_path, name) if is_model(folder)), None)

    def named(self, name: str) -> Iterator[Path]:
        """Yield the folders with this name on the model path; as in Gazebo, they need no model.config."""
        return (folder for folder in _children(self.model_path, name) if not name.startswith("."))

    def contains(self, path: Path) -> bool:
        """Return True if a path, with its links resolved, is in one of these, and not in .git."""
        if is_of_git(path):
            return False
        for folder in (path, *path.parents):
            is_usable = folder.is_dir() or folder.suffix.lower() in _MESHES
            if folder.parent in self.model_path and is_usable and not folder.name.startswith("."):
                return True
            if folder.parent in self._shares:
                return True
            if (folder / PACKAGE_FILE).is_file() and _is_below(folder, self._package_path):
                return True
            if is_model(folder) and _is_below(folder, self.model_path):
                return True
        return False

    @property
    def package_names(self) -> set[str]:
        """The names of the packages below ROS_PACKAGE_PATH."""
        return {name for tree in self._packages for name in tree.packages}

    def described(self, variables: Iterable[str]) -> tuple[str, ...]:
        """Return the variables with their values, such as "ROS_PACKAGE_PATH (not set)"."""
        return tuple(f"{variable} ({self.environment.get(variable) or 'not set'})" for variable in variables)

    @cached_property
    def _packages(self) -> tuple[PackageFolders, ...]:
        return tuple(folders_below(entry, inside_packages=False, follows_links=True) for entry in self._package_path)

    @cached_property
    def _package_path(self) -> tuple[Path, ...]:
        return self._entries("ROS_PACKAGE_PATH")

    @cached_property
    def _shares(self) -> tuple[Path, ...]:
        return tuple(prefix / "share" for prefix in self._entries("AMENT_PREFIX_PATH"))

    @cached_property
    def model_path(self) -> tuple[Path, ...]:
        """The folders in which Gazebo searches for models."""
        return tuple(entry for variable in MODEL_VARIABLES for entry in self._entries(variable))

    def _entries(self, variable: str) -> tuple[Path, ...]:
        paths = map(Path, self.environment.get(variable, "").split(os.pathsep))
        return tuple(path.resolve() for path in paths if path.is_absolute())


def _children(parents: Iterable[Path], name: str) -> Iterator[Path]:
    if "/" in name or "\0" in name or name in ("", ".", "..") or len(os.fsencode(name)) > _MAX_NAME_BYTES:
        return iter(())
    return (folder for parent in parents if (folder := parent / name).is_dir())


def _is_below(folder: Path, entries: Iterable[Path]) -> bool:
    return any(folder.is_relative_to(entry) for entry in entries)


def listed(places: Iterable[str]) -> str:
    """Return the first places as text."""
    first = list(islice(places, _PLACES_SHOWN + 1))
    return ", ".join([*first[:_PLACES_SHOWN], *(["..."] if len(first) > _PLACES_SHOWN else [])])


_PLACES_SHOWN: Final = 5


@dataclass(frozen=True, slots=True)
class Listings:
    """The names in folders, by their letters in lower case. Each folder is read once."""

    _names: dict[Path, dict[str, list[str]]] = field(default_factory=dict)

    def matched(self, folder: Path, path: str, may_read: Callable[[Path], bool]) -> Path | None:
        """Return the file at a path below a folder, in any letter case and with backslashes; None if there is none.

        Of several such names, the exact one is taken, else the first in the order of the alphabet. `folder`: without
        links; `may_read`: returns True if a folder without links in its path may be listed.
        """
        place = folder
        for part in PurePosixPath(path.replace("\\", "/")).parts:
            if part in ("/", ".."):
                place = Path("/") if part == "/" else place.parent
            elif not _may_list(place, may_read):
                return None
            else:
                names = self._in(place).get(part.casefold(), [])
                if not names:
                    return None
                place /= part if part in names else names[0]
        return place

    def similar(self, place: Path) -> list[str]:
        """Return the other names in the folder of a matched file that differ from its name in letter case only."""
        return [name for name in self._in(place.parent).get(place.name.casefold(), ()) if name != place.name]

    def _in(self, folder: Path) -> dict[str, list[str]]:
        if folder not in self._names:
            names = defaultdict[str, list[str]](list)
            try:
                with os.scandir(folder) as entries:
                    for name in sorted(entry.name for entry in islice(entries, _MAX_LISTED)):
                        names[name.casefold()].append(name)
            except (OSError, ValueError):  # no folder, no permission, or a NUL in its name
                pass
            self._names[folder] = dict(names)
        return self._names[folder]


def _may_list(place: Path, may_read: Callable[[Path], bool]) -> bool:
    try:
        return may_read(place.resolve())
    except (OSError, ValueError, RuntimeError):  # too long, a NUL in it, or a loop of links
        return False
