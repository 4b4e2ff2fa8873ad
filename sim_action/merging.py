"""`sim-action merge`, from the results of shards to those of one run: read -> join -> move traces -> report."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from sim_action.errors import ExitCode, UsageError
from sim_action.joining import Entry, Listing, joined
from sim_action.messages import escaped_line
from sim_action.outcome import RESULTS_FILE, Outcome, Results
from sim_action.reporting import ReportRequest, report_options, write_reports
from sim_action.result_files import ResultsFile, read_all
from sim_action.trace_files import TRACE_FOLDER, copy_trace, stored_file, trace_paths


@dataclass(frozen=True, slots=True)
class MergeRequest:
    """What the command line asks for; `results`: patterns, as they were typed; `listing`: what has to be in them."""

    results: Sequence[str]
    listing: Listing | None
    reports: ReportRequest


def merge(request: MergeRequest) -> ExitCode:
    """Joins results, writes every report, and returns what the process says to its caller."""
    files = read_all(request.results)
    entries = joined(files, request.listing)
    sources = [_trace_source(entry) for entry in entries]
    _refuse_to_overwrite(files, sources, request.reports)
    options = report_options(request.reports)
    outcomes = list(_with_traces(entries, sources, options.folder))
    added = [outcome for outcome, entry in zip(outcomes, entries, strict=True) if entry.origin is None]
    results = _results([file.results for file in files], outcomes)
    write_reports(results, options, annotated=results.model_copy(update={"outcomes": tuple(added)}))
    return results.exit_code


def _results(parts: Sequence[Results], outcomes: Iterable[Outcome]) -> Results:
    return Results(
        sim_action=_distinct(part.sim_action for part in parts),
        python=_distinct(part.python for part in parts),
        platform=_distinct(part.platform for part in parts),
        wall_time=max(part.wall_time for part in parts),
        outcomes=tuple(outcomes),
    )


def _distinct(texts: Iterable[str]) -> str:
    """Shards that were not alike are not called so."""
    return ", ".join(dict.fromkeys(texts))


def _trace_source(entry: Entry) -> Path | None:
    trace = entry.outcome.trace
    return stored_file(entry.origin.parent, trace) if entry.origin and trace else None


def _refuse_to_overwrite(files: Iterable[ResultsFile], sources: Iterable[Path | None], request: ReportRequest) -> None:
    """What is joined is still there afterwards."""
    written = [path.resolve() for path in (request.folder / RESULTS_FILE, request.junit) if path]
    traces = (request.folder / TRACE_FOLDER).resolve()
    for path in [file.path.resolve() for file in files] + [source for source in sources if source]:
        if path in written or traces in path.parents:
            why = f"{path} is to be joined, and would be overwritten"
            raise UsageError(escaped_line(f"{why}; choose another --output-dir or --junit"))


def _with_traces(entries: Sequence[Entry], sources: Sequence[Path | None], folder: Path) -> Iterator[Outcome]:
    """Each outcome, with its trace in `folder`, named as one run of all scenarios would have named it."""
    # A run has a name for the trace of whatever it could load.
    loaded = [place for place, entry in enumerate(entries) if entry.origin and not _is_invalid(entry.outcome)]
    paths = trace_paths([entries[place].outcome.name for place in loaded], folder)
    targets = dict(zip(loaded, paths, strict=True))
    for place, (entry, source) in enumerate(zip(entries, sources, strict=True)):
        yield _with_trace(entry.outcome, source, targets.get(place), folder)


def _is_invalid(outcome: Outcome) -> bool:
    return any(failure.kind == "invalid" for failure in outcome.failures)


def _with_trace(outcome: Outcome, source: Path | None, target: Path | None, folder: Path) -> Outcome:
    if not outcome.trace:
        return outcome
    if source is None or target is None:
        note = escaped_line(f"its trace {outcome.trace} is not beside the results of its shard")
        return outcome.model_copy(update={"trace": None, "notes": (*outcome.notes, note)})
    try:
        target.parent.mkdir(exist_ok=True)
        copy_trace(source, target)
    except OSError as error:
        raise UsageError(escaped_line(f"the trace {source} cannot be copied to {target}: {error.strerror}")) from None
    return outcome.model_copy(update={"trace": target.relative_to(folder).as_posix()})
