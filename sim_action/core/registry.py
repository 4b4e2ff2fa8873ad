"""Tables of the names that a scenario can use: from the name in YAML to the import path of its class.

Import paths are strings so that `--help` and `validate` load what the scenario uses and nothing else.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping
from typing import Generic, TypeVar, cast

from sim_action.core.records import dataclass

T = TypeVar("T")


@dataclass(frozen=True)
class Table(Generic[T]):
    """The names of one kind ("assertion", "command", ...), in the order of their lists.

    Attributes:
        kind: the noun for messages.
        paths: name -> "module:attribute".
    """

    kind: str
    paths: Mapping[str, str]

    def __contains__(self, name: object) -> bool:
        return name in self.paths

    def __iter__(self) -> Iterator[str]:
        return iter(self.paths)

    def load(self, name: str) -> T:
        """Return the class behind a name; raise KeyError for an unknown name."""
        module, _, attribute = self.paths[name].partition(":")
        return cast(T, getattr(importlib.import_module(module), attribute))
