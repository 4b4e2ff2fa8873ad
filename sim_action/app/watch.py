"""`sim-action run --watch`: run -> wait until files change -> run what they touch -> say what changed, until Ctrl-C."""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from sim_action.app import run as running
from sim_action.app.run import RunRequest
from sim_action.core.discovery import compared_name, discover, file_name, unique
from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.messages import log_line
from sim_action.core.process import Interruption
from sim_action.reports.comparison import print_comparison, rows
from sim_action.results.comparison import Thresholds, compared
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from sim_action.scenario.watched_files import Stamp, stamps, watched_files

# s between two looks; and how long nothing may change before what was saved is taken for whole.
_PERIOD: Final = 0.5
_QUIET: Final = 0.3
_MOST_TOLD: Final = 5

# How fast it was tells nothing here: the machine has others to work for.
_THRESHOLDS: Final = Thresholds(speed=0.0)


@dataclass(slots=True)
class _Watched:
    """What is looked at.

    Attributes:
        files: scenario file -> files that it is made of.
        folders: where others may come to be.
        seen: how all of these were when the last run began.
        ignored: what the runs write themselves.
    """

    files: dict[Path, frozenset[Path]] = field(default_factory=dict)
    folders: frozenset[Path] = frozenset()
    seen: dict[Path, Stamp] = field(default_factory=dict)
    ignored: set[Path] = field(default_factory=set)

    def paths(self) -> set[Path]:
        return set(self.folders).union(*self.files.values()) - self.ignored

    def changed(self) -> set[Path]:
        """What is not as it was."""
        return {path for path, stamp in stamps(self.seen).items() if stamp != self.seen[path]}

    def touched(self, changed: set[Path]) -> list[Path]:
        """The scenario files that are made of something that has changed."""
        return [file for file, made_of in self.files.items() if not changed.isdisjoint(made_of)]


def watch(request: RunRequest, patterns: Sequence[str], interruption: Interruption) -> ExitCode:
    """Runs everything, then what changes, one run after the other; `patterns`: what scenarios are found by.

    Raises UsageError if the first run cannot be begun; later ones only tell of it.
    """
    watched = _Watched()
    _look(watched, request, request.plan.suite.files, patterns)
    outcomes = _by_file(running.run(request, interruption))
    written = _without_written(watched, set())
    _note_watched(watched)
    while changed := _wait(watched, interruption):
        if touched := _touched(watched, changed, request, patterns):
            _note(f"changed: {_told(changed - watched.folders)}")
            outcomes |= _rerun(request, touched, outcomes, interruption)
            written = _without_written(watched, written)
            _note_watched(watched)
    return ExitCode.INTERRUPTED


def _look(watched: _Watched, request: RunRequest, files: Iterable[Path], patterns: Iterable[str]) -> None:
    """Takes in how scenario files, and what they are made of, are now."""
    for file in files:
        watched.files[file] = watched_files(file, allow_outside=request.plan.permissions.outside)
    folders = {Path(pattern) for pattern in patterns if Path(pattern).is_dir()}
    watched.folders = frozenset(folders | {file.parent for file in watched.files})
    watched.seen = stamps(watched.paths())


def _without_written(watched: _Watched, before: set[Path]) -> set[Path]:
    """What has changed while a run went on; what has done so in the run `before`, too, is looked at no longer.

    Else a log that a scenario names would have it run for ever. People write scenarios: these are looked at always.
    """
    now = {path for path in watched.changed() - watched.folders if path.suffix not in (".yml", ".yaml")}
    for path in sorted(now & before):
        _note(f"{os.path.relpath(path)} changes whenever this runs, and is watched no longer")
        watched.ignored.add(path)
        del watched.seen[path]
    return now


def _wait(watched: _Watched, interruption: Interruption) -> set[Path]:
    """What has changed, once that is whole; nothing if it is over."""
    now = watched.seen
    while now == watched.seen and not interruption.happened:
        _sleep(_PERIOD, interruption)
        now = stamps(watched.seen)
    before: Mapping[Path, Stamp] = {}
    while now != before and not interruption.happened:
        before = now
        _sleep(_QUIET, interruption)
        now = stamps(watched.seen)
    if interruption.happened:
        return set()
    # What was undone meanwhile touches nothing.
    return {path for path, stamp in now.items() if stamp != watched.seen[path]} or set(watched.folders)


def _sleep(seconds: float, interruption: Interruption) -> None:
    select.select([interruption.awakened], [], [], seconds)


def _touched(watched: _Watched, changed: set[Path], request: RunRequest, patterns: Sequence[str]) -> list[Path]:
    """The scenario files that are to be run, and are there; those that are new among them."""
    touched = watched.touched(changed)
    if changed & watched.folders:
        found = unique(discover(patterns))
        known = {compared_name(str(file)) for file in watched.files}
        touched += [file for file in found if compared_name(str(file)) not in known]
    for file in touched:
        if not file.exists():
            watched.files.pop(file, None)
    there = [file for file in touched if file.exists()]
    _look(watched, request, there, patterns)
    return there


def _rerun(
    request: RunRequest, touched: Sequence[Path], outcomes: Mapping[str, list[Outcome]], interruption: Interruption
) -> dict[str, list[Outcome]]:
    """The outcomes of these files, with what has changed told."""
    suite = replace(request.plan.suite, files=tuple(touched), empty=())
    try:
        results = running.run(replace(request, plan=replace(request.plan, suite=suite)), interruption)
    except UsageError as error:
        _note(str(error))
        return {}
    if interruption.happened:
        return {}
    found = {file_name(file): list[Outcome]() for file in touched} | _by_file(results)
    before = [outcome for file in found for outcome in outcomes.get(file, [])]
    comparison = compared(before, results.outcomes, _THRESHOLDS)
    if rows(comparison):
        print_comparison(comparison, os.environ)
    return found


def _by_file(results: Results) -> dict[str, list[Outcome]]:
    found: dict[str, list[Outcome]] = {}
    for outcome in results.outcomes:
        found.setdefault(outcome.file, []).append(outcome)
    return found


def _told(changed: set[Path]) -> str:
    names = sorted(os.path.relpath(path) for path in changed)
    more = f" and {len(names) - _MOST_TOLD} more" if len(names) > _MOST_TOLD else ""
    return (", ".join(names[:_MOST_TOLD]) + more) or "a scenario came"


def _note_watched(watched: _Watched) -> None:
    count = len(watched.paths() - watched.folders)
    _note(f"watching {count} {'file' if count == 1 else 'files'}; Ctrl-C ends")


def _note(message: str) -> None:
    sys.stderr.write(log_line(f"sim-action: {message}") + "\n")
    sys.stderr.flush()
