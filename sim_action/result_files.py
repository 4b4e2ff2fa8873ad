"""What earlier runs have left behind: finds and reads their `results.json`, which may be strangers'."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from sim_action.discovery import paths_of
from sim_action.errors import UsageError
from sim_action.messages import escaped_line
from sim_action.outcome import RESULTS_FILE, Outcome, Results


@dataclass(frozen=True, slots=True)
class ResultsFile:
    """A file and what is in it."""

    path: Path
    results: Results


def read_all(patterns: Iterable[str]) -> list[ResultsFile]:
    """The results behind files, folders (every `results.json` in and below) and globs; each file once.

    Raises UsageError for a pattern that finds none, and for a file that is not to be believed.
    """
    paths: dict[Path, Path] = {}
    for pattern in patterns:
        found = list(_matches(pattern))
        if not found:
            _refuse(f"no {RESULTS_FILE} in or at '{pattern}'")
        for path in found:
            paths.setdefault(path.resolve(), path)
    return [ResultsFile(path, _read(path)) for path in paths.values()]


def _matches(pattern: str) -> Iterator[Path]:
    for path in paths_of(pattern):
        if path.is_dir():
            yield from _below(path)
        elif path == Path(pattern) or path.suffix == ".json":
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
    """A failure without a reason, or a pass without an expectation or in spite of one."""
    if outcome.status == "error":
        return not outcome.failures
    failed = any(expected.failed for expected in outcome.expectations)
    return bool(outcome.failures) or not outcome.expectations or failed != (outcome.status == "failed")


def _refuse(message: str) -> NoReturn:
    raise UsageError(escaped_line(message))
