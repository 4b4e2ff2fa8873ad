"""Tables of the names that a scenario can use: from the name in YAML to the import path of its class.

Import paths are strings so that `--help` and `validate` load what the scenario uses and nothing else.

Installed packages may add names with entry points; the names of the tables win. Their metadata is read only for a name
that sim-action does not have itself, and a class is imported only when a scenario, or a list of all names, needs it.
"""

from __future__ import annotations

import importlib
import inspect
import sys
from collections.abc import Iterator, Mapping
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final, Generic, TypeVar, cast

from sim_action.core.records import dataclass
from sim_action.core.wording import escaped_line

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint
    from types import TracebackType

T = TypeVar("T")


class PackageProblem(ValueError):
    """The reason why a part of an installed package cannot be used; it names the package."""


GROUPS: Final = ("sim_action.assertions", "sim_action.commands", "sim_action.sensors")
"""The groups of entry points that packages use."""


@dataclass(frozen=True, eq=False)
class InstalledPart:
    """A name that scenarios can use, of an installed package."""

    entry: EntryPoint  # the entry point: the name, and the import path of its class
    # the distributions that have this name, each with its version. More than one is an error.
    packages: tuple[str, ...]

    @property
    def name(self) -> str:
        """The name in scenarios."""
        return self.entry.name

    @property
    def package(self) -> str:
        """The distribution and its version, such as "sim-action-wobble 0.1.0"."""
        return self.packages[0]

    def __str__(self) -> str:
        return f"'{self.name}' of {self.package}"

    def load(self, base: type) -> type:
        """Import and return the class. Raise PackageProblem if this fails, or if it is no `base` of that name."""
        if isinstance(self._loaded, PackageProblem):
            raise self._loaded
        if (reason := _why_no_part(self._loaded, base, self.name)) is not None:
            raise PackageProblem(f"{self}: {self.entry.value} {reason}")
        assert isinstance(self._loaded, type)
        return self._loaded

    @cached_property
    def _loaded(self) -> object:
        """The object that the entry point names, or the problem: a failed import is not repeated for each variation."""
        if len(self.packages) > 1:
            return PackageProblem(f"'{self.name}' is in {' and in '.join(self.packages)}; uninstall one of them")
        try:
            return self.entry.load()
        except (Exception, SystemExit) as error:  # noqa: BLE001 - code of others may raise anything
            return PackageProblem(f"{self} cannot be imported: {_error_text(error, _last_place(error.__traceback__))}")


def _why_no_part(target: object, base: type, name: str) -> str | None:
    """Return the problem of the object that an entry point names; None if it is the expected class."""
    if not isinstance(target, type) or not issubclass(target, base):
        return f"is not a subclass of sim_action.extending.{base.__name__}"
    if (key := getattr(target, "key", None)) != name:
        return f"has the key {key!r}; it must be '{name}', as the entry point is called"
    if inspect.isabstract(target):
        return f"has no {', '.join(sorted(getattr(target, '__abstractmethods__', ())))}"
    return None


def installed_parts(group: str) -> Mapping[str, InstalledPart]:
    """Return the parts of installed packages in a group of entry points, by name."""
    return _parts_on(group, tuple(sys.path))


@cache
def _parts_on(group: str, path: tuple[str, ...]) -> Mapping[str, InstalledPart]:
    """Return the parts of the packages on a search path."""
    entries_by_name: dict[str, list[tuple[EntryPoint, str]]] = {}
    of_group = [pair for pair in _entries(path) if pair[0].group == group]
    for entry, package in sorted(of_group, key=lambda pair: (pair[0].name, pair[1])):
        entries_by_name.setdefault(entry.name, []).append((entry, package))
    return {
        name: InstalledPart(entries[0][0], tuple(package for _, package in entries))
        for name, entries in entries_by_name.items()
    }


@cache
def _entries(_path: tuple[str, ...]) -> list[tuple[EntryPoint, str]]:
    """Return the entry points of all groups, each with its distribution; damaged distributions are left out."""
    from importlib import metadata

    entries: dict[str, list[tuple[EntryPoint, str]]] = {}
    for distribution in metadata.distributions():
        try:
            header = distribution.metadata
            package = f"{header['Name']} {header['Version']}"
            # The first one on the search path is the one that is imported.
            entries.setdefault(header["Name"], [(entry, package) for entry in distribution.entry_points])
        except Exception:  # noqa: BLE001, S112 - a damaged package that has nothing to do with a scenario
            continue
    return [pair for pairs in entries.values() for pair in pairs]


@dataclass(frozen=True)
class Table(Generic[T]):
    """The names of one kind ("assertion", ...); iteration gives our own, `all_names` adds names of packages."""

    kind: str  # the noun for messages
    paths: Mapping[str, str]  # name -> "module:attribute"
    group: str = ""  # the group of entry points with which installed packages add names; empty if they cannot
    base: type = object  # the class from which theirs derive

    def __contains__(self, name: object) -> bool:
        return name in self.paths

    def __iter__(self) -> Iterator[str]:
        return iter(self.paths)

    def installed(self) -> Mapping[str, InstalledPart]:
        """Return the parts that installed packages add, by name. The first call reads the metadata of all packages."""
        if not self.group:
            return {}
        return {name: part for name, part in installed_parts(self.group).items() if name not in self.paths}

    def all_names(self) -> tuple[str, ...]:
        """Return our own names, then names of installed packages."""
        return (*self.paths, *self.installed())

    def load(self, name: str) -> T:
        """Return the class behind a name; raise KeyError for an unknown name, PackageProblem for one of a package."""
        if name not in self.paths:
            return cast(T, self.installed()[name].load(self.base))
        module, _, attribute = self.paths[name].partition(":")
        return cast(T, getattr(importlib.import_module(module), attribute))


@dataclass(frozen=True)
class Blame:
    """A part of an installed package whose code raised an exception."""

    name: str  # of the part in scenarios
    message: str  # the package, the exception, and the place in its code


def blame(error: BaseException) -> Blame | None:
    """Return the part of an installed package whose code raised an exception; None if none did."""
    frames = list(_frames(error.__traceback__))
    for module, place in reversed(frames):
        for group in GROUPS if not module.startswith("sim_action.") else ():
            for part in installed_parts(group).values():
                if _top(part.entry.module) == _top(module):
                    return Blame(part.name, f"{part} raised {_error_text(error, place)}")
    return None


def _error_text(error: BaseException, place: str) -> str:
    return escaped_line(f"{type(error).__name__}: {error}{place and f' ({place})'}")


def _top(module: str) -> str:
    return module.partition(".")[0]


def _frames(traceback: TracebackType | None) -> Iterator[tuple[str, str]]:
    """Yield the module and the place of each frame, the innermost last."""
    while traceback is not None:
        code = traceback.tb_frame.f_code
        name = str(traceback.tb_frame.f_globals.get("__name__", ""))
        yield name, f"{Path(code.co_filename).name}:{traceback.tb_lineno}"
        traceback = traceback.tb_next


def _last_place(traceback: TracebackType | None) -> str:
    hidden = ("importlib", __name__)
    return next((place for name, place in reversed([*_frames(traceback)]) if not name.startswith(hidden)), "")
