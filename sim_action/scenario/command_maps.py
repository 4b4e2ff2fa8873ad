"""Command sources that are written as one map: `script: {file: a.py, class: A}` is `script: a.py` with `class: A`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from sim_action.commands import COMMANDS, CommandSource
from sim_action.core.errors import Problem
from sim_action.core.records import dataclass, field, replace
from sim_action.core.wording import did_you_mean
from sim_action.core.yaml_document import Document, KeyPath


@dataclass(frozen=True, slots=True)
class Unfolded:
    """A document whose command sources have all keys side by side.

    Attributes:
        document: it knows where the keys are written.
        problems: of the maps.
        refused: the paths of the sources with problems.
    """

    document: Document
    problems: tuple[Problem, ...] = ()
    refused: frozenset[KeyPath] = frozenset()


def unfolded(document: Document) -> Unfolded:
    """Return a document with the keys of each map of a command source next to its name."""
    commands = document.data.get("commands") if isinstance(document.data, dict) else None
    if isinstance(commands, tuple):
        found = [_Entry(("commands", index), entry) for index, entry in enumerate(commands)]
    else:
        found = [_Entry(("commands",), commands)]
    for entry in found:
        entry.unfold()
    moved = {path: place for entry in found for path, place in entry.moved.items()}
    problems = tuple(document.problem(*problem) for entry in found for problem in entry.problems)
    if not moved and not problems:
        return Unfolded(document)
    assert isinstance(document.data, dict)
    parts = tuple(entry.data for entry in found)
    data = {**document.data, "commands": parts if isinstance(commands, tuple) else parts[0]}
    refused = frozenset(entry.path for entry in found if entry.problems)
    return Unfolded(replace(document, data=data, moved={**document.moved, **moved}), problems, refused)


@dataclass(slots=True)
class _Entry:
    """One command source.

    Attributes:
        moved: paths of its keys -> their paths in the file.
    """

    path: KeyPath
    data: Any
    moved: dict[KeyPath, KeyPath] = field(default_factory=dict)
    problems: list[tuple[KeyPath, str]] = field(default_factory=list)

    def unfold(self) -> None:
        """Move the keys of a map next to the name of the source."""
        for name in [key for key, value in self._items() if isinstance(value, dict) and key in COMMANDS]:
            kind = COMMANDS.load(name)
            if kind.map_key is not None:
                self._take(name, kind, kind.map_key)

    def _take(self, name: str, kind: type[CommandSource], own: str) -> None:
        inner = self.data[name]
        beside = {key: value for key, value in self._items() if key != name}
        known = {own, *(field.alias or key for key, field in kind.model_fields.items())} - {name}
        self.problems += self._problems(name, own, known)
        place = (*self.path, name)
        self.moved |= {(*self.path, name if key == own else key): (*place, key) for key in inner}
        self.data = {**beside, **{name if key == own else key: value for key, value in inner.items()}}

    def _problems(self, name: str, own: str, known: set[str]) -> Iterator[tuple[KeyPath, str]]:
        inner = self.data[name]
        for key in inner:
            if key not in known:
                yield (*self.path, name, key), f"unknown key{did_you_mean(key, known)}"
            elif key in self.data:
                yield (*self.path, name, key), f"'{key}' is also given next to '{name}'; remove one of the two"
        if own not in inner and known.issuperset(inner):  # else it is misspelt
            yield (*self.path, name), f"the key '{own}' is missing"

    def _items(self) -> Iterator[tuple[str, Any]]:
        yield from self.data.items() if isinstance(self.data, dict) else ()
