"""What one scenario is read from, and one of its variations; be it one that can be run or not."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from pydantic import JsonValue

from sim_action.core.errors import Fault, InvalidScenario, Location, Problem
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import Document

_LONGEST_VALUES: Final = 100


@dataclass(frozen=True, slots=True)
class Varied:
    """A key of a scenario, as `variations` calls it, and the value that it has in one of them."""

    key: str
    value: JsonValue


@dataclass(frozen=True, slots=True)
class Source:
    """One scenario as it is written.

    Attributes:
        path: of its file, as it was named.
        workspace: where its own files are found.
        document: all of its keys, with those that it has from other files, and the place of each.
        name: how reports call it, which is its own name if it has one.
        line: where it begins in a file of several; None: its file holds nothing else.
        group: of a variation, the name of the scenario that is varied.
        variation: the values that make it this one.
        number: its place among all that its file holds, variations counted, from 1.
        draws: where values stand that are drawn at random, and what to say of one that cannot be.
    """

    path: Path
    workspace: Workspace
    document: Document
    name: str
    line: int | None = None
    group: str | None = None
    variation: tuple[Varied, ...] = ()
    number: int = 1
    draws: tuple[tuple[Location, str], ...] = ()

    @property
    def tags(self) -> tuple[str, ...]:
        """As far as they are what tags can be."""
        tags = self.document.data.get("tags") if isinstance(self.document.data, dict) else None
        return tuple(tag for tag in tags if isinstance(tag, str)) if isinstance(tags, tuple) else ()

    @property
    def values_in_file_names(self) -> str:
        """Of a variation, what its name adds to that of its group, as every file system has it; or empty."""
        values = self.name.removeprefix(self.group) if self.group is not None else ""
        return re.sub(r"[^A-Za-z0-9._=,+-]+", "-", values).strip("-")[:_LONGEST_VALUES]

    def is_of_draws(self, refused: Refused) -> bool:
        """Whether all that is wrong with it is wrong with values that are drawn at random."""
        places = {place for place, _ in self.draws}
        return isinstance(refused.error, InvalidScenario) and all(each.location in places for each in refused.problems)

    def refused_alone(self, refused: Refused) -> Refused:
        """This variation, where others of the scenario can be run."""
        draws = dict(self.draws)
        told = [Problem(each.location, f"{each.message} ({draws[each.location]})") for each in refused.problems]
        return replace(refused, name=self.name, group=self.group, variation=self.variation, error=InvalidScenario(told))

    def refused(self, error: InvalidScenario | Fault) -> Refused:
        """It, once it is known why it cannot be run."""
        return Refused(self.document.file, self.group or self.name, self.line, error, self.number)


@dataclass(frozen=True, slots=True)
class Refused:
    """A scenario that cannot be run, and what is wrong with it, or with us; the rest is as of a source."""

    file: str
    name: str
    line: int | None
    error: InvalidScenario | Fault
    number: int = 1
    group: str | None = None
    variation: tuple[Varied, ...] = ()

    @property
    def problems(self) -> tuple[Problem, ...]:
        """Each with its place."""
        if isinstance(self.error, Fault):
            return (Problem(Location(self.file, self.line), str(self.error)),)
        return self.error.problems
