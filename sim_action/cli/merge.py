"""`sim-action merge`."""

from __future__ import annotations

import platform
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import click

from sim_action.cli.options import (
    discovered,
    report_flags,
    report_request,
    selection_flags,
    taken_selection,
    text_option,
    typed,
)
from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.permissions import Permissions
from sim_action.core.provenance import platform_name
from sim_action.core.records import dataclass, replace
from sim_action.core.version import __version__
from sim_action.core.wording import escaped_line, note, shortened
from sim_action.core.workspace import compared_name
from sim_action.reports import ReportRequest
from sim_action.reports.writing import open_reports, write_reports
from sim_action.results.artifacts import RUN_FILE_FOLDERS, StoredFile, stored_files_of, trace_paths, with_copied_files
from sim_action.results.gates import over_variations
from sim_action.results.outcome import Failure, Outcome
from sim_action.results.results_json import RESULTS_FILE, Results, ResultsFile, find_all, read_all
from sim_action.results.shard_results import Entry, Listing, gates_of, merge_shards
from sim_action.scenario.variations.gate import PlannedGate


@click.command()
@click.argument("results", nargs=-1, required=True, metavar="RESULTS...")
@text_option(
    "--scenarios",
    metavar="PATH",
    text="A scenario file, folder or glob: the results must cover these scenarios; repeatable.",
    multiple=True,
)
@selection_flags
@report_flags
def merge(results: Sequence[str], scenarios: Sequence[str], **flags: Any) -> ExitCode:
    """Join the results of shards, and report them like one run.

    RESULTS are results.json files, globs, or folders. A folder stands for every results.json in it and below. If a
    shard is missing or not valid, or a scenario of --scenarios has no result, the joined results contain an error for
    it. Select scenarios here with the same options as for the shards.

    Exit code: as for `run`.
    """
    if not scenarios and (selecting := typed("only", "exclude", "tags", "exclude_tags")):
        needs = "needs" if len(selecting) == 1 else "need"
        raise UsageError(f"{', '.join(selecting)} {needs} --scenarios, the scenarios to select from")
    selection = taken_selection(flags)
    listing = None
    if scenarios:
        suite = replace(discovered(scenarios), selection=selection)
        if not suite.files:
            raise UsageError(
                "--scenarios finds no scenario; run merge in the checked-out repository, in the folder of the shards"
            )
        contents = suite.read(Permissions())
        listing = Listing(suite.numbered_in(contents), suite.empty, contents.unmatched)
    return merge_results(MergeRequest(results, listing, report_request(flags)))


_MAX_VERSION_CHARS: Final = 200  # a stranger may have written it, and each JUnit suite repeats it


@dataclass(frozen=True, slots=True)
class MergeRequest:
    """The options of `merge`; `results`: patterns, as typed; `listing`: the scenarios that must have a result."""

    results: Sequence[str]
    listing: Listing | None
    reports: ReportRequest


def merge_results(request: MergeRequest) -> ExitCode:
    """Join results, write every report and return the exit code. Raises UsageError."""
    lost: dict[Path, str] = {}
    files = _read(request, lost)
    entries = _with_versions(merge_shards(files, request.listing), files)
    entries += [Entry(_of_lost(path, reason)) for path, reason in lost.items()]
    evidence = [stored_files_of(entry.outcome, entry.origin.parent if entry.origin else None) for entry in entries]
    _refuse_to_overwrite([*(file.path for file in files), *lost], evidence, request.reports)
    with open_reports(request.reports) as options:
        options.room.reserve(len(entries))
        gates = gates_of(files, request.listing)
        outcomes = over_variations(list(_with_evidence(entries, evidence, options.folder)), gates)
        results = _results([file.results for file in files], outcomes, gates)
        # No shard has reported the missing scenarios, and none could judge a gate.
        of_shards = {place for place, entry in enumerate(entries) if entry.origin is not None}
        runs = [outcome for place, outcome in enumerate(results.runs) if place not in of_shards]
        added = (*runs, *(outcome for outcome in outcomes if outcome.statistics is not None))
        return write_reports(results, options, annotated=results.model_copy(update={"outcomes": added}))


def _of_lost(path: Path, reason: str) -> Outcome:
    message = f"{reason}; the verdicts in it are lost: run its shard again with this version of sim-action"
    failure = Failure(kind="missing", title="no results", message=message)
    return Outcome(name=escaped_line(str(path)), file="", status="error", failures=(failure,))


def _read(request: MergeRequest, invalid: dict[Path, str]) -> list[ResultsFile]:
    """Return the files to join, if any; `invalid` receives the reasons for invalid files."""
    matches = find_all(request.results)
    files = [file for file in read_all(matches, lost=invalid) if not _is_earlier_output(file, request)]
    empty = [pattern for pattern, paths in matches.items() if not paths or not files]
    for pattern in empty:
        lost = f"no {RESULTS_FILE} found at '{pattern}'"
        if not request.listing:
            ask = "download the results of the shards first, or list the scenarios with --scenarios"
            raise UsageError(escaped_line(f"{lost}: {ask}"))
        note(lost)
    return files


def _is_earlier_output(file: ResultsFile, request: MergeRequest) -> bool:
    """Return True for the output of an earlier merge that this call is going to overwrite."""
    path = compared_name(str(file.path))
    written = path == compared_name(str(request.reports.folder / RESULTS_FILE))
    if not (file.results.merged and written) or path in map(compared_name, request.results):
        return False
    note(f"{file.path} is skipped: an earlier merge wrote it, and this one overwrites it")
    return True


def _with_versions(entries: Sequence[Entry], files: Iterable[ResultsFile]) -> list[Entry]:
    """Return the entries, with a note of their version if the versions differ."""
    versions = {file.path: _distinct([file.results.sim_action]) for file in files}
    if len(set(versions.values())) <= 1:
        return list(entries)
    note(f"the results come from different versions of sim-action: {_distinct(versions.values())}")
    return [_with_version(entry, versions[entry.origin]) if entry.origin else entry for entry in entries]


def _with_version(entry: Entry, version: str) -> Entry:
    notes = (*entry.outcome.notes, f"it ran with sim-action {version}")
    return replace(entry, outcome=entry.outcome.model_copy(update={"notes": notes}))


def _results(parts: Sequence[Results], outcomes: Iterable[Outcome], gates: Iterable[PlannedGate]) -> Results:
    parts = parts or [_nothing()]
    return Results(
        sim_action=_distinct(part.sim_action for part in parts),
        python=_distinct(part.python for part in parts),
        platform=_distinct(part.platform for part in parts),
        started_at=min((part.started_at for part in parts if part.started_at), default=None),
        commit=next((part.commit for part in parts if part.commit), None),
        wall_time=max(part.wall_time for part in parts),
        merged=True,
        gates=tuple(gates),
        outcomes=tuple(outcomes),
    )


def _nothing() -> Results:
    """Return results without outcomes, for a merge that found no file."""
    return Results(
        sim_action=__version__, python=platform.python_version(), platform=platform_name(), wall_time=0.0, outcomes=()
    )


def _distinct(texts: Iterable[str]) -> str:
    return shortened(escaped_line(", ".join(dict.fromkeys(texts))), _MAX_VERSION_CHARS)


def _refuse_to_overwrite(paths: Iterable[Path], named: Iterable[Iterable[StoredFile]], request: ReportRequest) -> None:
    """Raise UsageError if the output would overwrite a file that is to be joined."""
    written = [compared_name(str(path)) for path in (request.folder / RESULTS_FILE, request.junit) if path]
    folders = [compared_name(str(request.folder / name)) for name in RUN_FILE_FOLDERS]
    for path in [*paths] + [file.source for files in named for file in files if file.source]:
        name = compared_name(str(path))
        if name in written or any(Path(name).is_relative_to(folder) for folder in folders):
            why = f"{name} is an input of the merge and would be overwritten"
            raise UsageError(escaped_line(f"{why}; choose another --output-dir or --junit"))


def _with_evidence(entries: Sequence[Entry], named: Sequence[Sequence[StoredFile]], folder: Path) -> Iterator[Outcome]:
    """Yield the outcomes with their files in `folder`, named as a single run of all scenarios names them."""
    # A run reserves a trace name for each scenario that it could load.
    loaded = [place for place, entry in enumerate(entries) if entry.origin and not _is_invalid(entry.outcome)]
    paths = trace_paths([entries[place].outcome.name for place in loaded], folder)
    traces = dict(zip(loaded, paths, strict=True))
    for place, (entry, files) in enumerate(zip(entries, named, strict=True)):
        yield with_copied_files(entry.outcome, files, traces.get(place), folder)


def _is_invalid(outcome: Outcome) -> bool:
    return any(failure.kind == "invalid" for failure in outcome.failures)
