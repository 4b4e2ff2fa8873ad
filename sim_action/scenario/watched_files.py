"""Find the files that a scenario file depends on, and detect changes of them.

Scenario -> bases -> models, scripts, logs -> files that models include. Nothing is checked here: a name without a
file is one more file that may appear.
"""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Hashable, Iterable, Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Final

from sim_action.core.errors import InvalidScenario
from sim_action.core.field_types import VARIATION
from sim_action.core.files import read_at_most
from sim_action.core.permissions import Permissions
from sim_action.core.records import dataclass, replace
from sim_action.core.workspace import PathError, Workspace
from sim_action.core.yaml_document import MAX_BYTES, read_document
from sim_action.robot.documents.packages import PackageError, Packages
from sim_action.scenario.source import Source

MAX_FILES: Final = 2_000  # the largest number of watched files of one scenario file; further ones are ignored
_MODELS: Final = frozenset({".urdf", ".xacro", ".sdf", ".world", ".xml", ".mjcf", ".config", ".obj"})
_MJCF: Final = frozenset({".xml", ".mjcf"})
_SCENARIOS: Final = frozenset({".yml", ".yaml"})
_MAX_MODEL_BYTES: Final = 20_000_000
_PERMISSIONS: Final = Permissions()
_LONGEST_NAME: Final = 500
# Attributes and elements that name files in URDF, xacro, SDF and MJCF, and the mtllib line of OBJ.
_NAMED: Final = re.compile(
    r"""\b(?:filename|file|uri)\s*=\s*["']([^"'\n]+)["']|<(?:uri|sdf|parameters)\b[^>]*>([^<\n]+)</|^mtllib (.+)$""",
    re.MULTILINE,
)
_MESH_FOLDER: Final = re.compile(r"""\b(?:meshdir|assetdir)\s*=\s*["']([^"'\n]+)["']""")
_PACKAGE_PATH: Final = re.compile(r"\$\(find ([\w.-]+)\)/?(.*)")
# The code of nodes, and what they read, in a package; C++ changes a run as soon as it is built.
_NODES: Final = (
    *("**/*.py", "**/*.launch", "**/*.xml", "**/*.yaml", "**/*.yml", "**/*.cpp", "**/*.hpp", "**/*.h"),
    *("scripts/*", "setup.cfg"),
)
# Where colcon installs a package, below a workspace.
_INSTALLED: Final = ("install/{0}/**/*", "install/lib/{0}/*", "install/share/{0}/**/*")
_PACKAGE: Final = re.compile(r"[A-Za-z][\w-]*")
_NODE_SOURCES: Final = ("ros1", "ros2")
_LOOKS_LIKE_A_FILE: Final = re.compile(r"[^\s:]*\.[A-Za-z]\w{0,9}")

Stamp = tuple[int, int, int] | None
"""The time of the last change of a file, its size and its identity; None if it does not exist."""


@dataclass(frozen=True, slots=True)
class _Reader:
    """Finds the files that names in a scenario's files lead to."""

    workspace: Workspace
    packages: Packages

    def closure(self, first: Path) -> set[Path]:
        """Return a file and all files that it leads to, up to a limit."""
        files, waiting, mesh_folders = {first}, [first], list[Path]()
        while waiting:
            for path in self._named_in(waiting.pop(), mesh_folders):
                if path not in files and len(files) < MAX_FILES and self._may_read(path):
                    files.add(path)
                    waiting.append(path)
        return files

    def readable(self, folder: Path, name: str) -> set[Path]:
        """Return the files that a scenario in this folder names, without files that may not be read."""
        return set(filter(self._may_read, self.at(folder, name)))

    def _may_read(self, path: Path) -> bool:
        """Return True if a path, which may be missing, leads into the workspace or a package."""
        try:
            return self.packages.may_read(path.resolve())
        except (OSError, ValueError, RuntimeError):  # too long, a NUL in it, or a loop of links
            return False

    def _named_in(self, path: Path, mesh_folders: list[Path]) -> Iterator[Path]:
        """Yield the files and folders that a file names; `mesh_folders`: of the MJCF files that led to it."""
        if path.suffix in _SCENARIOS:
            data = _document(path)
            for key in _NODE_SOURCES:
                for spec in _specs(data, key):
                    for package in dict.fromkeys(_packages_of_nodes(spec)):
                        yield from self._in_package(package, path)
                        if key == "ros2":
                            yield from self._installed(package, path.parent, spec.get("workspace"))
            for text in _texts(data):
                for name in _names_in(text):
                    yield from self.at(path.parent, name)
        elif path.suffix in _MODELS:
            yield from self._in_model(path, mesh_folders)
        elif path.suffix == ".py":
            # Its imports lie in the same folder.
            yield from _in_folder(path.parent, "*.py")

    def _in_package(self, name: str, referrer: Path) -> Iterator[Path]:
        """Yield the files of a package of ROS in the workspace; other packages do not change."""
        try:
            folder = self.packages.find(name, referrer).path
        except (PackageError, ValueError):
            return
        if folder.is_relative_to(self.workspace.root):
            yield from _in_folder(folder, *_NODES)

    def _installed(self, name: str, folder: Path, workspace: object) -> Iterator[Path]:
        """Yield the files of a package of ROS 2 that is built; `workspace`: where, as the scenario states it."""
        around = [folder / workspace, (folder / workspace).parent] if isinstance(workspace, str) else []
        around += [parent for parent in (folder, *folder.parents) if parent.is_relative_to(self.workspace.root)]
        for place in around:
            yield from _in_folder(place, *(pattern.format(name) for pattern in _INSTALLED))

    def at(self, folder: Path, name: str) -> Iterator[Path]:
        """Yield the file that a scenario in this folder names, or the files of the model in a folder of this name."""
        if len(name) > _LONGEST_NAME or not name.isprintable():
            return
        if "://" in name:
            yield from self._resolved(name, folder / "a scenario")
            return
        # Most texts of a scenario are no names of files.
        if not _LOOKS_LIKE_A_FILE.fullmatch(name) and not os.path.lexists(os.path.join(folder, name)):  # noqa: PTH118 - fast
            return
        try:
            path = replace(self.workspace, directory=folder).file_or_folder(name)
        except PathError:
            if _LOOKS_LIKE_A_FILE.fullmatch(name):
                yield from self._missing(folder / name)
            return
        # Only a folder with a model: any other may hold anything.
        yield from _in_folder(path, "*.sdf", "*.config") if path.is_dir() else (path,)

    def _missing(self, path: Path) -> Iterator[Path]:
        """Yield a file that does not exist yet, where it may appear."""
        place = Path(os.path.abspath(path))  # noqa: PTH100 - there is nothing yet that could be a link
        is_allowed = self.workspace.allow_outside or place.is_relative_to(self.workspace.root)
        if is_allowed and not os.path.lexists(place):
            yield place

    def _in_model(self, path: Path, mesh_folders: list[Path]) -> Iterator[Path]:
        text = (_bytes(path, _MAX_MODEL_BYTES) or b"").decode("utf-8", errors="replace")
        if path.suffix in _MJCF:
            mesh_folders += [path.parent / name for name in _MESH_FOLDER.findall(text)]
        for match in islice(_NAMED.finditer(text), MAX_FILES):
            reference = next(filter(None, match.groups())).strip()
            yield from self._resolved(reference, path)
            for folder in mesh_folders:
                yield from self._resolved(reference, folder / path.name)

    def _resolved(self, reference: str, referrer: Path) -> Iterator[Path]:
        try:
            if match := _PACKAGE_PATH.fullmatch(reference):
                yield self.packages.find(match[1], referrer).path / match[2]
            elif "$" not in reference:
                yield self.packages.resolve(reference, referrer).path
        except PackageError:
            return


def watched_files(scenario_file: Path, permissions: Permissions = _PERMISSIONS) -> frozenset[Path]:
    """Return the scenario file and all files that it depends on, up to a limit; links are followed."""
    first = scenario_file.absolute()
    try:
        workspace = Workspace.around(scenario_file, permissions)
    except (PathError, OSError, RuntimeError):
        return frozenset({first})
    return frozenset(_Reader(workspace, Packages(workspace, _mapped(_document(first)))).closure(first))


_NO_FILES: Final = frozenset[Path]()


class NamedFiles:
    """Finds the files that scenarios depend on, as `watched_files` does; each text is looked up once."""

    def __init__(self) -> None:
        self._readers: dict[Hashable, _Reader] = {}
        self._closures: dict[Hashable, frozenset[Path]] = {}
        self._absolute: dict[str, Path] = {}

    def of(self, source: Source) -> frozenset[Path]:
        """Return the files of a scenario and of the files that it extends; some may not exist."""
        data = source.document.data
        mapped = _mapped(data)
        key = (source.workspace, tuple(sorted(mapped.items())))
        if key not in self._readers:
            self._readers[key] = _Reader(source.workspace, Packages(source.workspace, mapped))
        reader = self._readers[key]
        texts = {_with_variation(text, source) for text in _texts(data)}
        written_in = [self._path(file) for file in (os.fspath(source.path), *source.document.files)]
        return frozenset(written_in).union(*[self._closure(reader, text) for text in texts])

    def _path(self, file: str) -> Path:
        if file not in self._absolute:
            self._absolute[file] = Path(file).absolute()
        return self._absolute[file]

    def _closure(self, reader: _Reader, text: str) -> frozenset[Path]:
        key = (id(reader), text)
        if key not in self._closures:
            folder = reader.workspace.directory
            named = {path for name in _names_in(text) for path in reader.readable(folder, name)}
            self._closures[key] = frozenset().union(*map(reader.closure, named)) if named else _NO_FILES
        return self._closures[key]


def _with_variation(text: str, source: Source) -> str:
    return text.replace(VARIATION, source.values_in_file_names) if VARIATION in text else text


def stamps(paths: Iterable[Path]) -> dict[Path, Stamp]:
    """Return a stamp for each path that changes when the file is written."""
    return {path: _stamp(path) for path in paths}


def _stamp(path: Path) -> Stamp:
    try:
        status = path.stat()
    except (OSError, ValueError):  # a NUL in it
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino


def _bytes(path: Path, most: int) -> bytes | None:
    try:
        return read_at_most(path, most)
    except (OSError, ValueError):
        return None


def _document(path: Path) -> object:
    """Return the content of a YAML file; None if it cannot be read, for example while it is written."""
    data = _bytes(path, MAX_BYTES)
    try:
        return None if data is None else read_document(path.name, data.decode("utf-8", errors="replace")).data
    except InvalidScenario:
        return None


def _mapped(data: object) -> Mapping[str, str]:
    """Return the valid entries of `robot.packages`."""
    robot = data.get("robot") if isinstance(data, dict) else None
    stated = robot.get("packages") if isinstance(robot, dict) else None
    pairs = stated.items() if isinstance(stated, dict) else ()
    return {name: folder for name, folder in pairs if isinstance(name, str) and isinstance(folder, str)}


def _specs(data: object, key: str) -> Iterator[Mapping[str, object]]:
    """Yield the values of a key, such as `ros2`, in `commands` of all robots."""
    world = data.get("world") if isinstance(data, dict) else None
    actors = world.get("actors") if isinstance(world, dict) else None
    for robot in (data, *(actors if isinstance(actors, tuple) else ())):
        commands = robot.get("commands") if isinstance(robot, dict) else None
        for source in commands if isinstance(commands, tuple) else (commands,):
            spec = source.get(key) if isinstance(source, dict) else None
            if isinstance(spec, dict):
                yield spec


def _packages_of_nodes(spec: Mapping[str, object]) -> Iterator[str]:
    """Yield the package names of the nodes and the launch file of a command source."""
    launch, nodes = spec.get("launch"), spec.get("nodes")
    named = [*(launch[:1] if isinstance(launch, tuple) else ()), *(nodes if isinstance(nodes, tuple) else ())]
    names = (node.get("package") if isinstance(node, dict) else node for node in named)
    packages = (name.partition("/")[0] for name in names if isinstance(name, str))
    yield from filter(_PACKAGE.fullmatch, packages)


def _texts(data: object) -> Iterator[str]:
    waiting = [data]
    while waiting:
        value = waiting.pop()
        if isinstance(value, str):
            yield value
        waiting += value.values() if isinstance(value, dict) else value if isinstance(value, tuple) else ()


def _names_in(text: str) -> Iterable[str]:
    return dict.fromkeys((text, *_words(text), text.partition(":")[0]))


def _words(text: str) -> list[str]:
    """Split a text into words as a command line is split."""
    try:
        return shlex.split(text)
    except ValueError:
        return []


def _in_folder(folder: Path, *patterns: str) -> Iterator[Path]:
    """Yield files by patterns, up to a limit, except bytecode, which changes with its source."""
    try:
        for pattern in patterns:
            files = (path for path in sorted(folder.glob(pattern)) if path.suffix != ".pyc" and path.is_file())
            yield from islice(files, MAX_FILES)
    except (OSError, ValueError):  # a NUL in its name
        return
