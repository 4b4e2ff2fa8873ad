"""The text of one scenario or variation, valid or refused, before it is a `Scenario`; and the random seed of its run.

A typed seed, such as `--seed 3`, overrides `seed:` of the scenario. It does not override a seed that variations
list, or draw. Each sample has a seed of its own, derived from the seed of its scenario.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from random import Random
from typing import Annotated, Final

from pydantic import Field, JsonValue

from sim_action.core.errors import InternalError, InvalidScenario, Location, Problem
from sim_action.core.records import dataclass, replace
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import Document, placed
from sim_action.scenario.variations.gate import PlannedGate

MAX_RUNS: Final = 10_000  # the largest number of runs of all scenarios of a file
MAX_KEYS: Final = 20  # the largest number of varied keys
SEED: Final = "seed"  # the key of the random seed
MAX_SEED: Final = 2**63 - 1
DRAWN_SEED_BITS: Final = 53  # many programs round larger numbers when they read JSON
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
    def tags(self) -> tuple[str, ...]:
        """The valid tags."""
        tags = self.document.data.get("tags") if isinstance(self.document.data, dict) else None
        return tuple(tag for tag in tags if isinstance(tag, str)) if isinstance(tags, tuple) else ()

    @property
    def values_in_file_names(self) -> str:
        """The part of a variation's name that its group lacks, safe for file names; or empty."""
        values = self.name.removeprefix(self.group) if self.group is not None else ""
        return re.sub(r"[^A-Za-z0-9._=,+-]+", "-", values).strip("-")[:_LONGEST_VALUES]

    @property
    def stated_seed(self) -> int | None:
        """The seed in its document, by default 0; None: it is invalid, and refused later with the scenario."""
        seed = self.document.data.get(SEED, 0) if isinstance(self.document.data, dict) else 0
        return seed if isinstance(seed, int) and not isinstance(seed, bool) and 0 <= seed <= MAX_SEED else None

    def seed_of_draws(self, typed: int | None) -> int | None:
        """Return the seed from which random draws and samples follow; None: it is invalid."""
        return self.stated_seed if typed is None or varies_seed(self.variation) else typed

    def sampled(self, sample: int, typed: int | None) -> Source:
        """Return the run with the seed of its sample, which follows from the seed of its scenario and this number."""
        if self.stated_seed is None:
            return self
        seed = self.seed_of_draws(typed)
        own = Random(f"sample {sample} of seed {seed}").getrandbits(DRAWN_SEED_BITS)
        data, _ = placed(self.document.data, (SEED,), own)
        return replace(self, document=replace(self.document, data=data), scenario_seed=seed)

    def overriding_seed(self, typed: int | None) -> int | None:
        """Return the typed seed if it overrides the seed of the run, which is complete otherwise."""
        return None if self.scenario_seed is not None or varies_seed(self.variation) else typed

    def is_of_draws(self, refused: Refused) -> bool:
        """Return True if all problems concern randomly drawn values."""
        places = {place for place, _ in self.draws}
        return isinstance(refused.error, InvalidScenario) and all(
            problem.location in places for problem in refused.problems
        )

    def refused_alone(self, refused: Refused) -> Refused:
        """Return this variation as refused; other variations of the scenario can run."""
        draws = dict(self.draws)
        problems = [
            Problem(problem.location, f"{problem.message} ({draws[problem.location]})") for problem in refused.problems
        ]
        return replace(
            refused,
            name=self.name,
            group=self.group,
            variation=self.variation,
            gate=self.gate,
            error=InvalidScenario(problems),
        )

    def refused(self, error: InvalidScenario | InternalError) -> Refused:
        """Return the scenario as refused."""
        name = self.group or self.name
        return Refused(self.document.file, name, self.line, error, self.number, tags=self.tags)


@dataclass(frozen=True, slots=True)
class Refused:
    """A scenario that cannot run, and the error; the other fields are as in its source."""

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
