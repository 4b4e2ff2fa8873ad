"""Join the results of shards into those of one run.

No outcome is lost, none occurs twice, and each scenario that no shard has run is listed as missing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby, zip_longest
from pathlib import Path, PurePosixPath
from typing import NoReturn

from sim_action.core.discovery import compared_name
from sim_action.core.errors import UsageError
from sim_action.core.messages import escaped_line
from sim_action.results.outcome import Failure, Outcome
from sim_action.results.results_json import ResultsFile
from sim_action.results.shards import Shard, shards_text
from sim_action.scenario.source import Refused, Source

Unit = tuple[str, int | None]
"""What is dealt as one: a scenario or a variation, by its file and its place in that."""


@dataclass(frozen=True, slots=True)
class Listing:
    """What has to be in the results, in the order of a run; `empty`: what was named but holds no scenario."""

    scenarios: Sequence[Source | Refused]
    empty: Sequence[str]


@dataclass(frozen=True, slots=True)
class Entry:
    """An outcome, and the results file that has it; None: none has it, it was added."""

    outcome: Outcome
    origin: Path | None = None


def joined(files: Sequence[ResultsFile], listing: Listing | None) -> list[Entry]:
    """All outcomes, as one run would list them, then those of missing shards.

    Without a listing, what is not of `--shard` is in the order of its file names. Raises UsageError if these are not
    results of one list, each part of it once.
    """
    sharded = [(shard, file) for file in files if (shard := file.results.shard)]
    _check_files(files)
    _check_shards(sharded)
    entries = _ordered(files, sharded)
    added = list(_not_run(entries, listing, left_any=bool(files))) if listing else []
    if listing:
        entries = _as_listed([*entries, *added], listing)
    return entries + [Entry(outcome) for outcome in _missing_shards(sharded, len(added))]


def _check_files(files: Iterable[ResultsFile]) -> None:
    """A scenario has an outcome for each engine that it ran on, by name; all of them are in the same results."""
    seen: dict[Unit, Path] = {}
    told = set[tuple[Unit, str]]()
    for path, outcome in ((file.path, outcome) for file in files for outcome in file.results.outcomes if outcome.file):
        unit, called = _unit(outcome), _called(outcome)
        if seen.setdefault(unit, path) != path:
            _refuse(f"both {seen[unit]} and {path} have results of {called}; nothing is counted twice")
        if (unit, outcome.name) in told:
            _refuse(f"{path} has results of {called} twice; nothing is counted twice")
        told.add((unit, outcome.name))


def _called(outcome: Outcome) -> str:
    return outcome.file if outcome.number is None else f"'{outcome.name}' in {outcome.file}"


def _unit(outcome: Outcome) -> Unit:
    return _compared(outcome), outcome.number


def _compared(outcome: Outcome) -> str:
    """Its file, spelled in one way; empty if it is not of one."""
    return compared_name(outcome.file) if outcome.file else ""


def _check_shards(sharded: Sequence[tuple[Shard, ResultsFile]]) -> None:
    """Whether these can be parts of one list."""
    seen: dict[int, Path] = {}
    for shard, file in sharded:
        other, first = sharded[0]
        if shard.count != other.count:
            _refuse(f"{first.path} is {other}, and {file.path} is {shard}: they are not of one run")
        if shard.total != other.total:
            _refuse(
                f"the shards saw different lists: {first.path} is {other} of {other.total} scenarios, "
                f"and {file.path} is {shard} of {shard.total}"
            )
        if shard.index in seen:
            _refuse(f"both {seen[shard.index]} and {file.path} are {shard}")
        seen[shard.index] = file.path
    for shard, _ in sharded[:1]:
        found = _count(sharded)
        if found > shard.total or (found < shard.total and len(sharded) == shard.count):
            _refuse(f"the shards saw different lists: each is of {shard.total} scenarios, and they have {found}")


def _ordered(files: Sequence[ResultsFile], sharded: Sequence[tuple[Shard, ResultsFile]]) -> list[Entry]:
    if len(files) in (1, len(sharded)):
        # Dealt one by one, they are taken back one by one.
        hands = [file for _, file in sorted(sharded, key=lambda pair: pair[0].index)] or files
        rounds = zip_longest(*map(_dealt, hands), fillvalue=())
        return [entry for turn in rounds for hand in turn for entry in hand]
    entries = [entry for file in files for entry in _entries(file)]
    return sorted(entries, key=lambda entry: (PurePosixPath(entry.outcome.file), entry.outcome.number or 0))


def _entries(file: ResultsFile) -> list[Entry]:
    return [Entry(outcome, file.path) for outcome in file.results.outcomes]


def _dealt(file: ResultsFile) -> list[list[Entry]]:
    """All outcomes of what was dealt as one."""
    return [list(entries) for _, entries in groupby(_entries(file), key=lambda entry: _unit(entry.outcome))]


def _as_listed(entries: Sequence[Entry], listing: Listing) -> list[Entry]:
    """What is not in the listing comes last."""
    files = [unit[0] for unit in _units(listing)] + [compared_name(escaped_line(pattern)) for pattern in listing.empty]
    places = {file: place for place, file in enumerate(dict.fromkeys(files))}

    def place(entry: Entry) -> tuple[int, int]:
        file, number = _unit(entry.outcome)
        return (places[file], number or 0) if file in places else (len(places), 0)

    return sorted(entries, key=place)


def _units(listing: Listing) -> list[Unit]:
    """Of the scenarios that are listed, in order."""
    files = [each.file if isinstance(each, Refused) else each.document.file for each in listing.scenarios]
    compared = {file: compared_name(file) for file in files}
    return [(compared[file], each.number) for file, each in zip(files, listing.scenarios, strict=True)]


def _not_run(entries: Iterable[Entry], listing: Listing, *, left_any: bool) -> Iterator[Entry]:
    found = {_unit(entry.outcome): entry.outcome for entry in entries}
    lost = "a result of this scenario; look at the jobs that were to run it"
    message = f"no shard has left {lost if left_any else 'any results; look at the jobs that were to run them'}"
    stopped = set[tuple[str, str]]()
    for unit, scenario in zip(_units(listing), listing.scenarios, strict=True):
        whole = (unit[0], _group(scenario))
        if unit in found and found[unit].failures and found[unit].group is None:
            # Where variations cannot be run, the first one of them tells of them all.
            stopped.add(whole)
        if unit not in found and (unit[0], None) not in found and whole not in stopped:
            yield Entry(_without_result(scenario, message))
    for pattern in listing.empty:
        if (compared_name(escaped_line(pattern)), None) not in found:
            yield Entry(Outcome.of_nothing(pattern))


def _group(scenario: Source | Refused) -> str:
    """The scenario that it is a variation of, if it is one."""
    return scenario.group or scenario.name if isinstance(scenario, Source) else scenario.name


def _without_result(scenario: Source | Refused, message: str) -> Outcome:
    failure = Failure(kind="missing", title="no result", message=message)
    if isinstance(scenario, Refused):
        return Outcome.of_refused(scenario).model_copy(update={"failures": (failure,)})
    return Outcome(
        name=scenario.name,
        file=scenario.document.file,
        line=scenario.line,
        number=scenario.number,
        group=scenario.group,
        variation=scenario.variation,
        status="error",
        failures=(failure,),
    )


def _missing_shards(sharded: Sequence[tuple[Shard, ResultsFile]], added: int) -> Iterator[Outcome]:
    """One for all: which of them should have run what is not known. If all was added by its name, that is enough."""
    for shard, _ in sharded[:1]:
        lost = shard.total - _count(sharded) - added
        missing = set(range(1, shard.count + 1)) - {present.index for present, _ in sharded}
        if lost > 0:
            name = shards_text(missing, shard.count)
            has, job = ("has", "its job") if len(missing) == 1 else ("have", "their jobs")
            message = f"{name} {has} left no results; {lost} of {shard.total} scenarios have none; look at {job}"
            failure = Failure(kind="missing", title="no results", message=message)
            yield Outcome(name=name, file="", status="error", failures=(failure,))


def _count(sharded: Iterable[tuple[Shard, ResultsFile]]) -> int:
    return sum(len(_dealt(file)) for _, file in sharded)


def _refuse(message: str) -> NoReturn:
    raise UsageError(escaped_line(message))
