"""The text of one scenario or variation, valid or refused, before it is a `Scenario`."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Final

from pydantic import Field, JsonValue

from sim_action.core.errors import InternalError, InvalidScenario, Location, Problem
from sim_action.core.records import dataclass, replace
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import Document
from sim_action.scenario.variations.gate import PlannedGate
from sim_action.scenario.variations.values import SEED

MAX_KEYS: Final = 20  # the largest number of varied keys
_LONGEST_VALUES: Final = 100


@dataclass(frozen=True, slots=True)
class Varied:
    """A varied key, as `variations` names it, and its value in one variation."""

    key: str
    value: JsonValue


Variation = Annotated[tuple[Varied, ...], Field(max_length=MAX_KEYS)]  # the varied keys of a run, and their values


def varies_seed(variation: Iterable[Varied]) -> bool:
    """Return True if the seed is one of the varied keys."""
    return SEED in (varied.key for varied in variation)


@dataclass(frozen=True, slots=True)
class Source:
    """One scenario as it is written."""

    path: Path  # of its file, as it was named
    workspace: Workspace  # in which its files are found
    document: Document  # all of its keys, also inherited ones, and the place of each
    name: str  # the name in reports
    line: int | None = None  # its first line in a file with several scenarios; None if the file has one
    group: str | None = None  # the name of the scenario that a variation belongs to
    variation: tuple[Varied, ...] = ()  # the values of this variation
    number: int = 1  # its place among all runs of its file, from 1
    draws: tuple[tuple[Location, str], ...] = ()  # key paths of randomly drawn values -> advice for an invalid one
    # the seed of the scenario, if this is one of its samples: each sample has a seed derived from it
    scenario_seed: int | None = None
    gate: PlannedGate | None = None  # the gate that judges this run together with others
    differs_by_seed: bool = False  # True if only the seed differs from the other runs of its gate
    equal_draws: tuple[str, ...] = ()  # the drawn keys of such a run: all of their values are equal

    @property
    def gate_name(self) -> str | None:
        """The name of its gate."""
        return None if self.gate is None else self.gate.name

    @property
    def tags(self) -> tuple[str, ...]:
        """The valid tags."""
        tags = self.document.data.get("tags") if isinstance(self.document.data, dict) else None
        return tuple(tag for tag in tags if isinstance(tag, str)) if isinstance(tags, tuple) else ()

    @property
    def values_in_file_names(self) -> str:
        """The part of a variation's name that its group lacks, safe for file names; or empty."""
        values = self.name.removeprefix(self.group) if self.group is not None else ""
        return re.sub(r"[^A-Za-z0-9._=,+-]+", "-", values).strip("-")[:_LONGEST_VALUES]

    def is_of_draws(self, refused: Refused) -> bool:
        """Return True if all problems concern randomly drawn values."""
        places = {place for place, _ in self.draws}
        return isinstance(refused.error, InvalidScenario) and all(each.location in places for each in refused.problems)

    def refused_alone(self, refused: Refused) -> Refused:
        """Return this variation as refused; other variations of the scenario can run."""
        draws = dict(self.draws)
        told = [Problem(each.location, f"{each.message} ({draws[each.location]})") for each in refused.problems]
        return replace(
            refused,
            name=self.name,
            group=self.group,
            variation=self.variation,
            gate=self.gate,
            error=InvalidScenario(told),
        )

    def refused(self, error: InvalidScenario | InternalError) -> Refused:
        """Return the scenario as refused."""
        name = self.group or self.name
        return Refused(self.document.file, name, self.line, error, self.number, tags=self.tags)


@dataclass(frozen=True, slots=True)
class Refused:
    """A scenario that cannot run, and the error; the other fields are those of its source."""

    file: str
    name: str
    line: int | None
    error: InvalidScenario | InternalError
    number: int = 1
    group: str | None = None
    tags: tuple[str, ...] = ()
    variation: tuple[Varied, ...] = ()
    gate: PlannedGate | None = None

    @property
    def problems(self) -> tuple[Problem, ...]:
        """The problems, each with its place."""
        if isinstance(self.error, InternalError):
            return (Problem(Location(self.file, self.line), str(self.error)),)
        return self.error.problems
