"""What earlier runs have left behind: finds and reads their `results.json`, which may be strangers'."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NoReturn

from sim_action.core.discovery import paths_of, unique
from sim_action.core.errors import UsageError
from sim_action.core.messages import escaped_line
from sim_action.results.file import RESULTS_FILE, Results
from sim_action.results.outcome import Outcome

MOST_OUTCOMES: Final = 50_000
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


def read_all(found: Mapping[str, Iterable[Path]], most: int = MOST_OUTCOMES) -> list[ResultsFile]:
    """Each file once. Raises UsageError for one that is not to be believed, and for too many outcomes."""
    files: list[ResultsFile] = []
    count = 0
    for path in unique(found):
        results = _read(path)
        count += len(results.outcomes)
        if count > most:
            _refuse(f"{path}: with its outcomes there are more than {most}, which is the most")
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
                _refuse(f"{path} is a link, which may lead anywhere; name the file itself")
            yield path


def _unreadable(error: OSError) -> NoReturn:
    _refuse(f"cannot look into {error.filename}: {error.strerror}")


def _read(path: Path) -> Results:
    results = Results.read(path)
    for outcome in results.outcomes:
        if _contradicts_itself(outcome):
            _refuse(f"{path} is no results file: what it says of '{outcome.file}' contradicts itself")
    return results


def _contradicts_itself(outcome: Outcome) -> bool:
    """A failure without a reason, a pass without an expectation or in spite of one, a verdict on what was not run."""
    if outcome.status in ("error", "flaky"):
        return not outcome.failures
    if outcome.status == "skipped":
        return bool(outcome.failures or outcome.expectations)
    failed = any(expected.failed for expected in outcome.expectations)
    return bool(outcome.failures) or not outcome.expectations or failed != (outcome.status == "failed")


def _refuse(message: str) -> NoReturn:
    raise UsageError(escaped_line(message))
