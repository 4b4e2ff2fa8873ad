"""Results: what became of all scenarios of a call; `results.json` is read and written here."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, NoReturn

from pydantic import ValidationError

from sim_action.core.discovery import paths_of, unique
from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.field_types import FrozenModel
from sim_action.core.files import read_at_most, whole_file
from sim_action.core.messages import escaped_line
from sim_action.results.outcome import NotNegative, Outcome, Status
from sim_action.results.shards import Shard

RESULTS_FILE = "results.json"

_MAX_BYTES: Final = 64_000_000


class Results(FrozenModel):
    """Everything that one call of `sim-action` found out; `results.json` is this, as JSON.

    Attributes:
        sim_action: version; of shards that were not alike, each that there was.
        wall_time: s that the call took; of shards that were joined, what the longest took.
        shard: which part of a list of scenarios this is of; left out: of all.
        some: whether the call named scenarios of files by their numbers, of which none may be left to tell of.
        merged: whether `sim-action merge` has written this, from the results of others.
    """

    version: Literal[1] = 1
    sim_action: str
    python: str
    platform: str
    wall_time: NotNegative
    shard: Shard | None = None
    some: bool = False
    merged: bool = False
    outcomes: tuple[Outcome, ...]

    @property
    def total(self) -> int:
        """How many scenarios there were."""
        return len(self.outcomes)

    def count(self, status: Status) -> int:
        """How many scenarios have a status."""
        return sum(outcome.status == status for outcome in self.outcomes)

    @property
    def exit_code(self) -> ExitCode:
        """The worst of all outcomes: 130, 3, 2, 1, 0; a shard without any is not to blame if others have some."""
        part = self.some or (self.shard and self.shard.total)
        of_nothing = ExitCode.PASSED if part else ExitCode.NO_SCENARIO
        return max((outcome.exit_code for outcome in self.outcomes), default=of_nothing)

    @property
    def conclusion(self) -> Literal["success", "failure", "cancelled"]:
        """In GitHub's words."""
        if self.exit_code is ExitCode.INTERRUPTED:
            return "cancelled"
        return "success" if self.exit_code is ExitCode.PASSED else "failure"

    @property
    def travelled(self) -> float | None:
        """m, if there was exactly one scenario."""
        return self.outcomes[0].travelled if self.total == 1 else None

    @property
    def real_time_factor(self) -> float | None:
        """Sim time of everything that was simulated over the wall time that it all took."""
        sim_time = sum(outcome.simulated for outcome in self.outcomes)
        return sim_time / self.wall_time if sim_time and self.wall_time > 0 else None

    def worst_first(self) -> list[Outcome]:
        """Errors, then failures, then warnings, then what was not run, then the rest, each in the order of the call."""
        return sorted(self.outcomes, key=_badness)

    def write(self, folder: Path) -> Path:
        """Writes `results.json` into a folder that exists; returns its path."""
        path = folder / RESULTS_FILE
        with whole_file(path) as file:
            file.write((self.model_dump_json(indent=2) + "\n").encode())
        return path

    @classmethod
    def read(cls, path: Path) -> Results:
        """Reads a `results.json`, which may be a stranger's. Raises UsageError."""
        try:
            if (data := read_at_most(path, _MAX_BYTES)) is not None:
                return cls.model_validate_json(data)
            reason = f"it is larger than {_MAX_BYTES / 1e6:g} MB"
        except OSError as error:
            reason = error.strerror or str(error)
        except ValidationError as error:
            reason = _first_finding(error)
        raise UsageError(escaped_line(f"{path} is no results file: {reason}"))


def _first_finding(error: ValidationError) -> str:
    """Where and what; keys that a stranger made up are not repeated."""
    details, more = error.errors(include_url=False, include_input=False)[0], error.error_count() - 1
    steps = [str(step) for step in details["loc"] if isinstance(step, int) or step.isidentifier()]
    told = ": ".join(part for part in (".".join(steps), details["msg"]) if part)
    return f"{told} (and {more} more)" if more else told


def _badness(outcome: Outcome) -> int:
    if outcome.status != "passed":
        return {"error": 0, "flaky": 1, "failed": 2, "skipped": 4}[outcome.status]
    return 3 if any(expectation.warned for expectation in outcome.expectations) else 5


MAX_OUTCOMES: Final = 50_000
"""To join so many takes half a minute and most of a gigabyte."""


@dataclass(frozen=True, slots=True)
class ResultsFile:
    """A file and what is in it."""

    path: Path
    results: Results


def find_all(patterns: Iterable[str]) -> dict[str, list[Path]]:
    """The files behind each pattern: a file, a folder (every `results.json` in it and below), or a glob of these.

    Raises UsageError for what cannot be looked into.
    """
    return {pattern: list(_matches(pattern)) for pattern in patterns}


def read_all(found: Mapping[str, Iterable[Path]], most: int = MAX_OUTCOMES) -> list[ResultsFile]:
    """Each file once. Raises UsageError for one that is not to be believed, and for too many outcomes."""
    files: list[ResultsFile] = []
    count = 0
    for path in unique(found):
        results = _read_consistent(path)
        count += len(results.outcomes)
        if count > most:
            _reject(f"{path}: with its outcomes there are more than {most}, which is the most")
        files.append(ResultsFile(path, results))
    return files


def _matches(pattern: str) -> Iterator[Path]:
    for path in paths_of(pattern):
        if path.is_dir():
            yield from _below(path)
        elif os.path.lexists(path) and (path == Path(pattern) or path.suffix == ".json"):
            yield path


def _below(folder: Path) -> Iterator[Path]:
    for parent, folders, files in os.walk(folder, onerror=_unreadable):
        folders.sort()
        path = Path(parent, RESULTS_FILE)
        if RESULTS_FILE in files:
            if path.is_symlink():
                _reject(f"{path} is a link, which may lead anywhere; name the file itself")
            yield path


def _unreadable(error: OSError) -> NoReturn:
    _reject(f"cannot look into {error.filename}: {error.strerror}")


def _read_consistent(path: Path) -> Results:
    results = Results.read(path)
    for outcome in results.outcomes:
        if _contradicts_itself(outcome):
            _reject(f"{path} is no results file: what it says of '{outcome.file}' contradicts itself")
    return results


def _contradicts_itself(outcome: Outcome) -> bool:
    """A failure without a reason, a pass without an expectation or in spite of one, a verdict on what was not run."""
    if outcome.status in ("error", "flaky"):
        return not outcome.failures
    if outcome.status == "skipped":
        return bool(outcome.failures or outcome.expectations)
    failed = any(expected.failed for expected in outcome.expectations)
    return bool(outcome.failures) or not outcome.expectations or failed != (outcome.status == "failed")


def _reject(message: str) -> NoReturn:
    raise UsageError(escaped_line(message))
