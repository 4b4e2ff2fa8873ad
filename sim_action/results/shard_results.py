"""Merge the results of shards into the results of one run.

No outcome is lost, none occurs twice, and each scenario that no shard has run becomes an error.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from itertools import groupby, zip_longest
from pathlib import Path, PurePosixPath
from typing import NoReturn

from sim_action.core.errors import UsageError
from sim_action.core.records import dataclass
from sim_action.core.wording import escaped_line
from sim_action.core.workspace import compared_name
from sim_action.results.gates import over_variations
from sim_action.results.outcome import Failure, Outcome
from sim_action.results.results_json import RESULTS_FILE, ResultsFile, Shard, find_all, read_all, shards_text
from sim_action.scenario.selection import Unmatched
from sim_action.scenario.source import Refused, Source
from sim_action.scenario.variations.gate import PlannedGate

Unit = tuple[str, int | None]  # The key of a scenario or variation: its file and number. Shards divide a list by units.


@dataclass(frozen=True, slots=True)
class Listing:
    """The scenarios that the results have to contain, in run order."""

    scenarios: Sequence[Source | Refused]
    empty: Sequence[str]  # the paths without a scenario
    unmatched: Sequence[Unmatched] = ()  # the patterns of names, and the tags, that select no scenario


@dataclass(frozen=True, slots=True)
class Entry:
    """An outcome and the results file that contains it; None for an outcome that was added by the merge."""

    outcome: Outcome
    origin: Path | None = None


def merge_shards(files: Sequence[ResultsFile], listing: Listing | None) -> list[Entry]:
    """Return all outcomes in the order of a single run, followed by errors for missing shards.

    Without a listing, results that were not made with `--shard` are sorted by file name. Raises UsageError if the
    files are not distinct parts of one list.
    """
    sharded = [(shard, file) for file in files if (shard := file.results.shard)]
    # Outcomes of several engines have distinct names in one file.
    seen: dict[Unit, Path] = {}
    seen_outcomes = set[tuple[Unit, str]]()
    for path, outcome in ((file.path, outcome) for file in files for outcome in file.results.runs if outcome.file):
        unit = _unit(outcome)
        called = _called(outcome)
        if seen.setdefault(unit, path) != path:
            _reject(f"both {seen[unit]} and {path} contain results of {called}; each scenario may occur only once")
        if (unit, outcome.name) in seen_outcomes:
            _reject(f"{path} contains results of {called} twice; each scenario may occur only once")
        seen_outcomes.add((unit, outcome.name))
    _check_shards(sharded)
    _check_commits(files)
    entries = _ordered(files, sharded)
    added = list(_not_run(entries, listing, left_any=bool(files))) if listing else []
    if listing:
        entries = _as_listed([*entries, *added], listing)
    return entries + [Entry(outcome) for outcome in _missing_shards(sharded, len(added))]


def gates_of(files: Iterable[ResultsFile], listing: Listing | None = None) -> tuple[PlannedGate, ...]:
    """Return the gates of all files and scenarios. Raises UsageError if two state one gate differently."""
    gates: dict[tuple[str, str], tuple[PlannedGate, Path]] = {}
    for path, gate in ((file.path, gate) for file in files for gate in file.results.gates):
        first, where = gates.setdefault((compared_name(gate.file), gate.name), (gate, path))
        if first != gate:
            _reject(f"{where} and {path} state different gates for '{gate.name}'; run all shards on the same files")
    listed = [scenario.gate for scenario in listing.scenarios if scenario.gate is not None] if listing else []
    for gate in listed:
        first, where = gates.setdefault((compared_name(gate.file), gate.name), (gate, Path()))
        if (first.gate, first.runs) != (gate.gate, gate.runs):
            same = "run all shards on the same files"
            _reject(f"the gate of '{gate.name}' in {where} is not that of {gate.file}; {same}")
    return tuple(gate for gate, _ in gates.values())


def _called(outcome: Outcome) -> str:
    return outcome.file if outcome.number is None else f"'{outcome.name}' in {outcome.file}"


def _unit(outcome: Outcome) -> Unit:
    return _compared(outcome), outcome.number


def _compared(outcome: Outcome) -> str:
    return compared_name(outcome.file) if outcome.file else f"{outcome.name}\0"


def _check_shards(sharded: Sequence[tuple[Shard, ResultsFile]]) -> None:
    """Raise UsageError unless the files can be parts of one list."""
    seen: dict[int, Path] = {}
    for shard, file in sharded:
        other, first = sharded[0]
        if shard.count != other.count:
            _reject(f"{first.path} is {other}, and {file.path} is {shard}: they do not belong to one run")
        if shard.total != other.total:
            _reject(
                f"the shards belong to different lists: {first.path} is {other} with {other.total} scenarios, "
                f"and {file.path} is {shard} with {shard.total}"
            )
        if shard.index in seen:
            _reject(f"both {seen[shard.index]} and {file.path} are {shard}")
        seen[shard.index] = file.path
    for shard, _ in sharded[:1]:
        total = _count(sharded)
        if total > shard.total or (total < shard.total and len(sharded) == shard.count):
            _reject(
                f"the shards belong to different lists: each states a total of {shard.total}, "
                f"but together they contain {total} scenarios"
            )


def _check_commits(files: Sequence[ResultsFile]) -> None:
    """Raise UsageError for results of different commits, such as results that an earlier workflow has left."""
    stated = [(file.results.commit[:12], file.path) for file in files if file.results.commit]
    for commit, path in stated:
        if commit != stated[0][0]:
            first, where = stated[0]
            _reject(f"{where} is of commit {first}, and {path} of {commit}: run all shards on the same commit")


def _ordered(files: Sequence[ResultsFile], sharded: Sequence[tuple[Shard, ResultsFile]]) -> list[Entry]:
    if len(files) in (1, len(sharded)):
        # The scenarios were distributed in turn, so they are collected in turn.
        hands = [file for _, file in sorted(sharded, key=lambda pair: pair[0].index)] or files
        rounds = zip_longest(*map(_dealt, hands), fillvalue=())
        return [entry for turn in rounds for hand in turn for entry in hand]
    entries = [entry for file in files for entry in _entries(file)]
    return sorted(entries, key=lambda entry: (PurePosixPath(entry.outcome.file), entry.outcome.number or 0))


def _entries(file: ResultsFile) -> list[Entry]:
    return [Entry(outcome, file.path) for outcome in file.results.runs]


def _dealt(file: ResultsFile) -> list[list[Entry]]:
    return [list(entries) for _, entries in groupby(_entries(file), key=lambda entry: _unit(entry.outcome))]


def _as_listed(entries: Sequence[Entry], listing: Listing) -> list[Entry]:
    """Return the entries in the order of the listing; entries that are not listed come last."""
    files = [unit[0] for unit in _units(listing)] + [compared_name(escaped_line(pattern)) for pattern in listing.empty]
    places = {file: place for place, file in enumerate(dict.fromkeys(files))}

    def place(entry: Entry) -> tuple[int, int]:
        file, number = _unit(entry.outcome)
        return (places[file], number or 0) if file in places else (len(places), 0)

    return sorted(entries, key=place)


def _units(listing: Listing) -> list[Unit]:
    files = [
        scenario.file if isinstance(scenario, Refused) else scenario.document.file for scenario in listing.scenarios
    ]
    compared = {file: compared_name(file) for file in files}
    return [(compared[file], scenario.number) for file, scenario in zip(files, listing.scenarios, strict=True)]


def _not_run(entries: Iterable[Entry], listing: Listing, *, left_any: bool) -> Iterator[Entry]:
    outcomes = {_unit(entry.outcome): entry.outcome for entry in entries}
    lost = "a result for this scenario; check the jobs that should have run it"
    message = (
        f"no shard returned {lost if left_any else 'any results; check the jobs that should have run the scenarios'}"
    )
    stopped = set[tuple[str, str]]()
    for unit, scenario in zip(_units(listing), listing.scenarios, strict=True):
        whole = (unit[0], (scenario.group or scenario.name if isinstance(scenario, Source) else scenario.name))
        if unit in outcomes and outcomes[unit].failures and outcomes[unit].group is None:
            # If the variations of a scenario cannot be run, the error of the first one covers all of them.
            stopped.add(whole)
        if unit not in outcomes and (unit[0], None) not in outcomes and whole not in stopped:
            yield Entry(_without_result(scenario, message))
    for pattern in listing.empty:
        if (compared_name(escaped_line(pattern)), None) not in outcomes:
            yield Entry(Outcome.of_nothing(pattern))
    for unmatched in map(Outcome.of_unmatched, listing.unmatched):
        if _unit(unmatched) not in outcomes:
            yield Entry(unmatched)


def _without_result(scenario: Source | Refused, message: str) -> Outcome:
    failure = Failure(kind="missing", title="no result", message=message)
    if isinstance(scenario, Refused):
        return Outcome.of_refused(scenario).model_copy(update={"failures": (failure,)})
    return Outcome.of_source(scenario, failure)


def _missing_shards(sharded: Sequence[tuple[Shard, ResultsFile]], added: int) -> Iterator[Outcome]:
    """Yield one error for all missing shards, unless each of their scenarios has got an error of its own already."""
    for shard, _ in sharded[:1]:
        lost = shard.total - _count(sharded) - added
        missing = set(range(1, shard.count + 1)) - {present.index for present, _ in sharded}
        if lost > 0:
            name = shards_text(missing, shard.count)
            job = "its job" if len(missing) == 1 else "their jobs"
            message = f"{name} returned no results; {lost} of {shard.total} scenarios have none; check {job}"
            failure = Failure(kind="missing", title="no results", message=message)
            yield Outcome(name=name, file="", status="error", failures=(failure,))


def _count(sharded: Iterable[tuple[Shard, ResultsFile]]) -> int:
    return sum(len(_dealt(file)) for _, file in sharded)


def _reject(message: str) -> NoReturn:
    raise UsageError(escaped_line(message))


@dataclass(frozen=True, slots=True)
class EarlierRun:
    """A run that has ended."""

    name: str  # its results, as typed
    outcomes: tuple[Outcome, ...]  # the outcomes, including gates
    # `id()` of an outcome -> the folder of its results file, from which its files are named
    folders: Mapping[int, Path]
    gates: tuple[PlannedGate, ...] = ()  # the gates as they are stated
    started_at: datetime | None = None  # started_at, commit: as in `Results`
    commit: str | None = None


def read_run(pattern: str) -> EarlierRun:
    """Return one run, joined as by `merge`: a missing shard is an error outcome. Raises UsageError."""
    files = read_all(find_all([pattern]))
    if not files:
        raise UsageError(escaped_line(f"no {RESULTS_FILE} found at '{pattern}'; name a results file or its folder"))
    entries = merge_shards(files, None)
    gates = gates_of(files)
    outcomes = over_variations([entry.outcome for entry in entries], gates)
    # The gates are judged again; the runs keep their order.
    runs = [outcome for outcome in outcomes if outcome.statistics is None]
    origins = [entry.origin for entry in entries if entry.outcome.statistics is None]
    folders = {id(run): origin.parent for run, origin in zip(runs, origins, strict=True) if origin is not None}
    started = min((file.results.started_at for file in files if file.results.started_at), default=None)
    return EarlierRun(pattern, outcomes, folders, gates, started, files[0].results.commit)
