"""The use case `run --watch`: run all scenarios, then rerun the affected ones whenever files change."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Final

from sim_action.app.live import live_beside
from sim_action.app.run import RunRequest, run_scenarios
from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.process import Interruption
from sim_action.core.records import dataclass, field, replace
from sim_action.core.wording import counted, first_of, note
from sim_action.core.workspace import compared_name, discover, file_name, unique
from sim_action.reports.comparison import print_comparison, rows
from sim_action.results.comparison import Thresholds, compare_outcomes
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from sim_action.scenario.variations.gate import PlannedGate
from sim_action.scenario.watched_files import Stamp, stamps, watched_files

_POLL_S: Final = 0.5
# A saved file counts as complete once nothing has changed for this time.
_QUIET_S: Final = 0.3
_MAX_NAMES: Final = 5
_THRESHOLDS: Final = Thresholds(speed=0.0)  # speed is not compared: the developer's machine does other work


@dataclass(slots=True)
class _Watched:
    """The files that are watched."""

    files: dict[Path, frozenset[Path]] = field(default_factory=dict)  # scenario file -> the files that it depends on
    folders: frozenset[Path] = frozenset()  # where new scenario files may appear
    seen: dict[Path, Stamp] = field(default_factory=dict)  # the state of all of them when the last run began
    ignored: set[Path] = field(default_factory=set)  # files that the runs write themselves

    def paths(self) -> set[Path]:
        return set(self.folders).union(*self.files.values()) - self.ignored

    def changed(self) -> set[Path]:
        """Return the paths whose state differs from `seen`."""
        return {path for path, stamp in stamps(self.seen).items() if stamp != self.seen[path]}

    def touched(self, changed: set[Path]) -> list[Path]:
        """Return the scenario files that depend on a changed path."""
        return [file for file, made_of in self.files.items() if not changed.isdisjoint(made_of)]


@dataclass(slots=True)
class _FileResults:
    """The results of one scenario file: outcomes, including outcomes of gates, and the gates as they are stated."""

    outcomes: list[Outcome] = field(default_factory=list)
    gates: list[PlannedGate] = field(default_factory=list)


def watch_scenarios(
    request: RunRequest, patterns: Sequence[str], interruption: Interruption, *, live_port: int | None = None
) -> ExitCode:
    """Run all scenarios, then the affected ones after each change, until interrupted.

    `patterns` are the paths that were typed; `live_port`: the port of `--live`; None: nothing is served. Raises
    UsageError if the first run cannot start; later runs only print the error.
    """
    with nullcontext() if live_port is None else live_beside(request.reports.folder, live_port):
        watched = _Watched()
        _look(watched, request, request.plan.suite.files, patterns)
        results_by_file = _by_file(run_scenarios(request, interruption).results)
        written = _without_written(watched, set())
        _note_watched(watched)
        while changed := _wait(watched, interruption):
            if touched := _touched(watched, changed, request, patterns):
                note(f"changed: {_names(changed - watched.folders)}")
                results_by_file |= _rerun(request, touched, results_by_file, interruption)
                written = _without_written(watched, written)
                _note_watched(watched)
        return ExitCode.of_command(is_interrupted=True)


def _look(watched: _Watched, request: RunRequest, files: Iterable[Path], patterns: Iterable[str]) -> None:
    """Store the present state of scenario files and of the files that they depend on."""
    for file in files:
        watched.files[file] = watched_files(file, request.plan.permissions)
    folders = {Path(pattern) for pattern in patterns if Path(pattern).is_dir()}
    watched.folders = frozenset(folders | {file.parent for file in watched.files})
    watched.seen = stamps(watched.paths())


def _without_written(watched: _Watched, before: set[Path]) -> set[Path]:
    """Return the files that changed during a run; files that changed in two runs are no longer watched."""
    now = {path for path in watched.changed() - watched.folders if path.suffix not in (".yml", ".yaml")}
    for path in sorted(now & before):
        note(f"{os.path.relpath(path)} changes in every run and is no longer watched")
        watched.ignored.add(path)
        del watched.seen[path]
    return now


def _wait(watched: _Watched, interruption: Interruption) -> set[Path]:
    """Wait for a change to be complete and return the changed paths; nothing if interrupted."""
    now = watched.seen
    while now == watched.seen and not interruption.happened:
        _sleep(_POLL_S, interruption)
        now = stamps(watched.seen)
    before: Mapping[Path, Stamp] = {}
    while now != before and not interruption.happened:
        before = now
        _sleep(_QUIET_S, interruption)
        now = stamps(watched.seen)
    if interruption.happened:
        return set()
    # A change that was undone meanwhile affects nothing.
    return {path for path, stamp in now.items() if stamp != watched.seen[path]} or set(watched.folders)


def _sleep(seconds: float, interruption: Interruption) -> None:
    interruption.wait(seconds)


def _touched(watched: _Watched, changed: set[Path], request: RunRequest, patterns: Sequence[str]) -> list[Path]:
    """Return the existing scenario files to run again, including new ones."""
    touched = watched.touched(changed)
    if changed & watched.folders:
        files = unique(discover(patterns, outside=request.plan.permissions.outside))
        watched_names = {compared_name(str(file)) for file in watched.files}
        touched += [file for file in files if compared_name(str(file)) not in watched_names]
    for file in touched:
        if not file.exists():
            watched.files.pop(file, None)
    existing = [file for file in touched if file.exists()]
    _look(watched, request, existing, patterns)
    return existing


def _rerun(
    request: RunRequest, touched: Sequence[Path], earlier: Mapping[str, _FileResults], interruption: Interruption
) -> dict[str, _FileResults]:
    """Return the new results of these files and print the differences."""
    suite = replace(request.plan.suite, files=tuple(touched), empty=(), complete=False)
    try:
        results = run_scenarios(replace(request, plan=replace(request.plan, suite=suite)), interruption).results
    except UsageError as error:
        note(str(error))
        return {}
    if interruption.happened:
        return {}
    results_by_file = {file_name(file): _FileResults() for file in touched} | _by_file(results)
    before, now = (
        [results_of.get(file, _FileResults()) for file in results_by_file] for results_of in (earlier, results_by_file)
    )
    comparison = compare_outcomes(
        [outcome for file_results in before for outcome in file_results.outcomes],
        [outcome for file_results in now for outcome in file_results.outcomes],
        _THRESHOLDS,
        allow_removed=True,
        gates=(
            [gate for file_results in before for gate in file_results.gates],
            [gate for file_results in now for gate in file_results.gates],
        ),
    )
    if rows(comparison):
        print_comparison(comparison, os.environ)
    return results_by_file


def _by_file(results: Results) -> dict[str, _FileResults]:
    """Return the results of each file, in the order of the call."""
    results_by_file: dict[str, _FileResults] = {}
    for outcome in results.outcomes:
        results_by_file.setdefault(outcome.file, _FileResults()).outcomes.append(outcome)
    for gate in results.gates:
        results_by_file.setdefault(gate.file, _FileResults()).gates.append(gate)
    return results_by_file


def _names(changed: set[Path]) -> str:
    return first_of(sorted(os.path.relpath(path) for path in changed), _MAX_NAMES) or "a new scenario"


def _note_watched(watched: _Watched) -> None:
    note(f"watching {counted(len(watched.paths() - watched.folders), 'file')}; press Ctrl-C to stop")
