"""Joins the results of shards: no outcome is lost, none is there twice, and what nobody has run is told."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby, zip_longest
from pathlib import Path, PurePosixPath
from typing import NoReturn

from sim_action.discovery import compared_name, file_name
from sim_action.errors import UsageError
from sim_action.messages import escaped_line
from sim_action.outcome import Failure, Outcome
from sim_action.result_files import ResultsFile
from sim_action.sharding import Shard, shards_text


@dataclass(frozen=True, slots=True)
class Listing:
    """What has to be in the results, in the order of a run; `empty`: what was named but holds no scenario."""

    files: Sequence[Path]
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
    """A file has an outcome for each engine that it ran on, by name; all of them are in the same results."""
    seen: dict[str, Path] = {}
    told = set[tuple[str, str]]()
    for file in files:
        for outcome in file.results.outcomes:
            name = _compared(outcome)
            if name and seen.setdefault(name, file.path) != file.path:
                _refuse(f"both {seen[name]} and {file.path} have results of {outcome.file}; nothing is counted twice")
            if name and (name, outcome.name) in told:
                _refuse(f"{file.path} has results of {outcome.file} twice; nothing is counted twice")
            told.add((name, outcome.name))


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
    return sorted(entries, key=lambda entry: PurePosixPath(entry.outcome.file))


def _entries(file: ResultsFile) -> list[Entry]:
    return [Entry(outcome, file.path) for outcome in file.results.outcomes]


def _dealt(file: ResultsFile) -> list[list[Entry]]:
    """What was dealt as one: all outcomes of a scenario file."""
    return [list(entries) for _, entries in groupby(_entries(file), key=lambda entry: _compared(entry.outcome))]


def _as_listed(entries: Sequence[Entry], listing: Listing) -> list[Entry]:
    """What is not in the listing comes last."""
    places = {name: place for place, name in enumerate(_names(listing))}
    return sorted(entries, key=lambda entry: places.get(_compared(entry.outcome), len(places)))


def _names(listing: Listing) -> list[str]:
    """As a run reports them."""
    names = [*map(file_name, listing.files), *map(escaped_line, listing.empty)]
    return [compared_name(name) for name in names]


def _not_run(entries: Iterable[Entry], listing: Listing, *, left_any: bool) -> Iterator[Entry]:
    found = {_compared(entry.outcome) for entry in entries}
    lost = "a result of this scenario; look at the jobs that were to run it"
    message = f"no shard has left {lost if left_any else 'any results; look at the jobs that were to run them'}"
    outcomes = [_without_result(path, message) for path in listing.files] + [*map(Outcome.of_nothing, listing.empty)]
    return (Entry(outcome) for name, outcome in zip(_names(listing), outcomes, strict=True) if name not in found)


def _without_result(path: Path, message: str) -> Outcome:
    failure = Failure(kind="missing", title="no result", message=message)
    return Outcome(name=escaped_line(path.name), file=file_name(path), status="error", failures=(failure,))


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
