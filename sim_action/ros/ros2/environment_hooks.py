"""The environment variables of install prefixes: the changes of their setup.bash, read from .dsv files without a shell.

A .dsv file has a change per line, such as `prepend-non-duplicate;PYTHONPATH;lib/python3.12/site-packages` (colcon and
ament write it next to each script). A script without such a file cannot be read, and is named instead.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Final

from sim_action.core.files import read_at_most
from sim_action.core.records import dataclass

_SHELLS: Final = frozenset({".sh", ".bash"})
_INDEX: Final = Path("share/ament_index/resource_index")
# Folders with a file for each package; the file has its dependencies, separated by `:` or `;`.
_INDEXES: Final = (_INDEX / "packages", _INDEX / "package_run_dependencies", Path("share/colcon-core/packages"))
_MAX_FILE_BYTES: Final = 100_000
_MAX_DEPTH: Final = 5


@dataclass(frozen=True, slots=True)
class SetUp:
    """The environment of sourced prefixes.

    Attributes:
        variables: the variables that the prefixes set or extend.
        unread: scripts that would have to be run by a shell.
    """

    variables: Mapping[str, str]
    unread: tuple[str, ...] = ()


def packages_of_prefix(prefix: Path) -> list[str]:
    """Return the names of the packages that are installed in a prefix, each after its dependencies."""
    found: dict[str, set[str]] = {}
    for index in _INDEXES:
        for file in _files(prefix / index):
            found.setdefault(file.name, set()).update(_text(file).replace(os.pathsep, ";").split(";"))
    graph = {name: sorted(found[name] & found.keys() - {name}) for name in sorted(found)}
    try:
        return list(TopologicalSorter(graph).static_order())
    except CycleError:
        return list(graph)


def set_up(prefixes: Iterable[Path], environment: Mapping[str, str]) -> SetUp:
    """Return the environment after the setup.bash of each prefix, the last one of the list first.

    :param environment: the variables before.
    """
    changes = _Changes(environment)
    for prefix in reversed(list(prefixes)):
        for package in packages_of_prefix(prefix):
            changes.read_first(prefix, (f"share/{package}/package.dsv", f"share/{package}/local_setup.dsv"))
        # The hook of some builds is missing; all tools of ROS 2 need this variable.
        changes.prepend("AMENT_PREFIX_PATH", str(prefix))
    return SetUp(changes.variables, tuple(dict.fromkeys(changes.unread)))


class _Changes:
    """Collects the changes of .dsv files."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._environment = environment
        self.variables: dict[str, str] = {}
        self.unread: list[str] = []

    def read_first(self, prefix: Path, names: Iterable[str]) -> None:
        """Read the first of the files that exists."""
        file = next((path for name in names if (path := prefix / name).is_file()), None)
        if file is not None:
            self._read(prefix, file, _MAX_DEPTH)

    def prepend(self, name: str, path: str) -> None:
        """Put a path first in a variable, unless it is there."""
        before = self._paths(name)
        self.variables[name] = os.pathsep.join(before if path in before else (path, *before))

    def _append(self, name: str, path: str) -> None:
        before = self._paths(name)
        self.variables[name] = os.pathsep.join(before if path in before else (*before, path))

    def _paths(self, name: str) -> tuple[str, ...]:
        return tuple(path for path in self._value(name).split(os.pathsep) if path)

    def _value(self, name: str) -> str:
        return self.variables.get(name, self._environment.get(name, ""))

    def _read(self, prefix: Path, file: Path, depth: int) -> None:
        scripts: dict[Path, set[str]] = {}
        for line in _text(file).splitlines():
            kind, semicolon, rest = line.partition(";")
            if not semicolon or line.startswith("#"):
                continue
            if kind == "source":
                path = prefix / rest
                scripts.setdefault(path.with_suffix(""), set()).add(path.suffix)
            else:
                self._change(prefix, kind, rest.split(";"))
        for script, suffixes in scripts.items():
            hook = script.with_name(f"{script.name}.dsv")
            if hook.is_file() and depth:
                self._read(prefix, hook, depth - 1)
            elif found := sorted(suffixes & _SHELLS, reverse=True):
                self.unread.append(f"{script}{found[0]}")

    def _change(self, prefix: Path, kind: str, words: list[str]) -> None:
        name, values = words[0], words[1:]
        paths = [str(prefix / value) if value else str(prefix) for value in values]
        match kind:
            case "prepend-non-duplicate" | "prepend-non-duplicate-if-exists":
                for path in paths:
                    if not kind.endswith("exists") or Path(path).exists():
                        self.prepend(name, path)
            case "append-non-duplicate":
                for path in paths:
                    self._append(name, path)
            case "set" | "set-if-unset":
                value = ";".join(values)
                if kind == "set" or not self._value(name):
                    self.variables[name] = str(prefix / value) if (prefix / value).exists() else value
            case _:
                pass


def _files(folder: Path) -> Iterator[Path]:
    try:
        return (path for path in sorted(folder.iterdir()) if path.is_file() and not path.name.startswith("."))
    except OSError:
        return iter(())


def _text(path: Path) -> str:
    try:
        return (read_at_most(path, _MAX_FILE_BYTES) or b"").decode(errors="replace")
    except OSError:
        return ""
