"""Find the files that a scenario file depends on, and detect changes of them.

Scenario -> bases -> models, scripts, logs -> files that models include. Nothing is checked here: a name without a
file is one more file that may appear.
"""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Final

from sim_action.core.errors import InvalidScenario
from sim_action.core.files import read_at_most
from sim_action.core.workspace import PathError, Workspace
from sim_action.core.yaml_document import MAX_BYTES, read_document
from sim_action.robot.packages import PackageError, Packages

MAX_FILES: Final = 2_000
"""The largest number of watched files of one scenario file; further ones are ignored."""

_MODELS: Final = frozenset({".urdf", ".xacro", ".sdf", ".world", ".xml", ".mjcf", ".config", ".obj"})
_SCENARIOS: Final = frozenset({".yml", ".yaml"})
_MAX_MODEL_BYTES: Final = 20_000_000
_LONGEST_NAME: Final = 500
# Attributes and elements that name files in URDF, xacro, SDF and MJCF, and the mtllib line of OBJ.
_NAMED: Final = re.compile(
    r"""\b(?:filename|file|uri)\s*=\s*["']([^"'\n]+)["']|<(?:uri|sdf)\b[^>]*>([^<\n]+)</|^mtllib (.+)$""",
    re.MULTILINE,
)
_FOUND: Final = re.compile(r"\$\(find ([\w.-]+)\)/?(.*)")
_NODES: Final = ("**/*.py", "**/*.launch", "**/*.yaml", "package.xml")
_LOOKS_LIKE_A_FILE: Final = re.compile(r"[^\s:]*\.[A-Za-z]\w{0,9}")

Stamp = tuple[int, int, int] | None
"""The time of the last change of a file, its size and its identity; None if it does not exist."""


@dataclass(frozen=True, slots=True)
class _Reader:
    """Finds the files that names in a scenario's files lead to."""

    workspace: Workspace
    packages: Packages

    def named_in(self, path: Path) -> Iterator[Path]:
        """Yield the files and folders that a file names."""
        if path.suffix in _SCENARIOS:
            yield from self._in_scenario(path)
        elif path.suffix in _MODELS:
            yield from self._in_model(path)
        elif path.suffix == ".py":
            # Its imports lie in the same folder.
            yield from _in_folder(path.parent, "*.py")

    def _in_scenario(self, path: Path) -> Iterator[Path]:
        data = _document(path)
        for package in dict.fromkeys(_packages_of_nodes(data)):
            yield from self._in_package(package, path)
        for text in _texts(data):
            for name in dict.fromkeys((text, *_words(text), text.partition(":")[0])):
                yield from self._at(path.parent, name)

    def _in_package(self, name: str, referrer: Path) -> Iterator[Path]:
        """Yield the files of a ROS 1 package in the workspace; other packages do not change."""
        try:
            folder = self.packages.find(name, referrer).path
        except (PackageError, ValueError):
            return
        if folder.is_relative_to(self.workspace.root):
            yield from _in_folder(folder, *_NODES)

    def _at(self, folder: Path, name: str) -> Iterator[Path]:
        if len(name) > _LONGEST_NAME or not name.isprintable():
            return
        if "://" in name:
            yield from self._resolved(name, folder / "a scenario")
            return
        try:
            found = Workspace(folder, self.workspace.root, self.workspace.allow_outside).file_or_folder(name)
        except PathError:
            if _LOOKS_LIKE_A_FILE.fullmatch(name):
                yield from self._missing(folder / name)
            return
        # Only a folder with a model: any other may hold anything.
        yield from _in_folder(found, "*.sdf", "*.config") if found.is_dir() else (found,)

    def _missing(self, path: Path) -> Iterator[Path]:
        """Yield a file that does not exist yet, where it may appear."""
        place = Path(os.path.abspath(path))  # noqa: PTH100 - there is nothing yet that could be a link
        is_allowed = self.workspace.allow_outside or place.is_relative_to(self.workspace.root)
        if is_allowed and not os.path.lexists(place):
            yield place

    def _in_model(self, path: Path) -> Iterator[Path]:
        text = (_bytes(path, _MAX_MODEL_BYTES) or b"").decode("utf-8", errors="replace")
        for match in islice(_NAMED.finditer(text), MAX_FILES):
            yield from self._resolved(next(filter(None, match.groups())).strip(), path)

    def _resolved(self, reference: str, referrer: Path) -> Iterator[Path]:
        try:
            if found := _FOUND.fullmatch(reference):
                yield self.packages.find(found[1], referrer).path / found[2]
            elif "$" not in reference:
                yield self.packages.resolve(reference, referrer).path
        except PackageError:
            return


def watched_files(scenario_file: Path, *, allow_outside: bool = False) -> frozenset[Path]:
    """Return the scenario file and all files that it depends on, up to a limit; links are followed."""
    first = scenario_file.absolute()
    try:
        workspace = Workspace.around(scenario_file, allow_outside=allow_outside)
    except (PathError, OSError, RuntimeError):
        return frozenset({first})
    reader = _Reader(workspace, Packages(workspace, _mapped(_document(first))))
    found, waiting = {first}, [first]
    while waiting:
        for path in reader.named_in(waiting.pop()):
            if path not in found and len(found) < MAX_FILES:
                found.add(path)
                waiting.append(path)
    return frozenset(found)


def stamps(paths: Iterable[Path]) -> dict[Path, Stamp]:
    """Return a stamp for each path that changes when the file is written."""
    return {path: _stamp(path) for path in paths}


def _stamp(path: Path) -> Stamp:
    try:
        found = path.stat()
    except (OSError, ValueError):  # a NUL in it
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino


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


def _packages_of_nodes(data: object) -> Iterator[str]:
    """Yield the package names of `commands: {ros1: ...}`."""
    commands = data.get("commands") if isinstance(data, dict) else None
    for source in commands if isinstance(commands, tuple) else (commands,):
        spec = source.get("ros1") if isinstance(source, dict) else None
        launch, nodes = (spec.get("launch"), spec.get("nodes")) if isinstance(spec, dict) else (None, None)
        named = [*(launch[:1] if isinstance(launch, tuple) else ()), *(nodes if isinstance(nodes, tuple) else ())]
        names = (node.get("package") if isinstance(node, dict) else node for node in named)
        yield from (name.partition("/")[0] for name in names if isinstance(name, str))


def _texts(data: object) -> Iterator[str]:
    waiting = [data]
    while waiting:
        value = waiting.pop()
        if isinstance(value, str):
            yield value
        waiting += value.values() if isinstance(value, dict) else value if isinstance(value, tuple) else ()


def _words(text: str) -> list[str]:
    """Split a text into words as a command line is split."""
    try:
        return shlex.split(text)
    except ValueError:
        return []


def _in_folder(folder: Path, *patterns: str) -> Iterator[Path]:
    try:
        yield from (path for pattern in patterns for path in islice(sorted(folder.glob(pattern)), MAX_FILES))
    except OSError:
        return
