"""Writing the reports: the table of all reports, the output folder of a call, and messages about what was not written.

Every module that a message needs is imported before the run: at the end there may be no descriptor left for an import.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Mapping
from collections.abc import Set as AbstractSet
from contextlib import contextmanager, suppress
from itertools import chain
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, Protocol, TextIO

from sim_action.core.errors import ExitCode, InternalError, UsageError
from sim_action.core.records import replace
from sim_action.core.registry import Table
from sim_action.core.wording import escaped_line, log_line, system_reason
from sim_action.reports import ReportOptions, ReportRequest, workspace_of
from sim_action.reports.display import STATUS_DISPLAYS, display_of
from sim_action.reports.escaping import log_text, one_line
from sim_action.reports.formatting import first_reason
from sim_action.reports.scenario_groups import grouped_scenarios
from sim_action.results import output_folder
from sim_action.results.artifacts import REPORT_FILE, RUN_FILE_FOLDERS, with_existing_files
from sim_action.results.journal import JOURNAL_FILE, manifest
from sim_action.results.output_folder import JUNIT_FILE, is_foreign, is_own_junit, refuse_foreign_files
from sim_action.results.results_json import RESULTS_FILE, Results

if TYPE_CHECKING:
    from sim_action.results.shard_results import EarlierRun


class Report(Protocol):
    """The function that writes one report."""

    def __call__(self, results: Results, options: ReportOptions) -> None:
        """Write the report, if its target exists."""


REPORTS: Final = Table[Report](
    "report",
    {
        "junit": "sim_action.reports.junit:write_junit",
        "report": "sim_action.reports.html.report:write_html",
        "summary": "sim_action.reports.github.job_summary:write_summary",
        "outputs": "sim_action.reports.github.step_outputs:write_outputs",
        "terminal": "sim_action.reports.terminal:print_results",
        "annotations": "sim_action.reports.github.annotations:write_annotations",
    },
)
"""The reports in the order of writing: files first, because the reader of the terminal output may have closed it.

The JUnit XML comes before the large `report.html`, which may fill the disk.
"""

_VARIABLES: Final = MappingProxyType(
    {"summary": "GITHUB_STEP_SUMMARY", "outputs": "GITHUB_OUTPUT", "annotations": "GITHUB_ACTIONS"}
)
"""Name of a report that only GitHub reads -> the variable that GitHub sets for it. Elsewhere it is not imported."""

_SCENARIO_SUFFIXES: Final = frozenset({".yml", ".yaml"})
_RESULTS: Final = "results"
_PRINTED: Final = frozenset({"terminal", "annotations"})


@contextmanager
def open_reports(request: ReportRequest, *, keeps_earlier: bool = False) -> Iterator[ReportOptions]:
    """Open the output folder for one call until its reports are written, and yield the options of the reports.

    The folder is created and locked. Unless `keeps_earlier`, the files of the earlier call are removed: a call that is
    killed must not leave reports that are not its own. Raises UsageError.
    """
    _check_targets(request)
    # Before anything is removed or run: the results of the earlier run may not be there.
    against = None if request.against is None else _earlier_run(request.against, request.folder)
    folder = _created_folder(request.folder)
    with output_folder.locked(folder) as room:
        if not keeps_earlier:
            remove_earlier(request)
        yield ReportOptions(
            folder=folder,
            junit=request.junit or folder / JUNIT_FILE,
            junit_strict=request.junit_strict,
            environment=os.environ,
            workspace=workspace_of(os.environ, Path.cwd()),
            verbosity=request.verbosity,
            silenced=request.silenced,
            against=against,
            room=room,
        )


def _earlier_run(pattern: str, folder: Path) -> EarlierRun:
    """Return the run to compare with. Raise UsageError, also for the results that this call overwrites."""
    from sim_action.results.shard_results import read_run  # a usual run does without it

    try:
        run = read_run(pattern)
    except UsageError as error:
        raise UsageError(f"--against: {error}") from None
    if os.path.realpath(folder) in {os.path.realpath(place) for place in run.folders.values()}:
        raise UsageError(
            escaped_line(
                f"--against {pattern} is the output folder of this call; keep the earlier results in another folder, "
                "or name another --output-dir"
            )
        )
    return run


def _check_targets(request: ReportRequest) -> None:
    """Raise UsageError if a report must not be written to its place, or the place cannot be looked at."""
    junit = request.junit
    try:
        for place in (*(request.folder / name for name in RUN_FILE_FOLDERS), *([junit.parent] if junit else [])):
            _refuse_links(place)
        if junit is not None:
            if junit.is_dir():
                raise UsageError(escaped_line(f"--junit {junit} is a folder; name a file"))
            if junit.exists() and not junit.is_file():
                raise UsageError(escaped_line(f"--junit {junit} is not a regular file; name a file"))
            _refuse_other_file(junit, request.folder)
        refuse_foreign_files(request.folder)
    except (OSError, ValueError) as error:
        where = (
            f"--output-dir {request.folder}" if junit is None else f"--output-dir {request.folder} or --junit {junit}"
        )
        raise UsageError(escaped_line(f"{where} cannot be used: {system_reason(error)}")) from None


def remove_earlier(request: ReportRequest, kept: AbstractSet[str] = frozenset()) -> None:
    """Remove the files of the earlier call in the output folder, apart from those named in `kept`."""
    output_folder.remove_earlier_files(request.folder, set(manifest(request.folder)) - kept)
    output_folder.remove_unfinished_files(request.folder)
    if request.junit is not None:
        with suppress(OSError):
            output_folder.remove_regular(request.junit)


def make_ready(options: ReportOptions) -> None:
    """Import the modules of all reports while the process waits: it takes time, and files that may lack later."""
    # An import that fails now may succeed later; otherwise it is reported as the fault of its report.
    with suppress(OSError, ImportError):
        for name in _enabled_reports(options):
            REPORTS.load(name)


def _enabled_reports(options: ReportOptions) -> list[str]:
    unread = {name for name, variable in _VARIABLES.items() if not options.environment.get(variable)}
    return [name for name in REPORTS if name not in options.silenced and name not in unread]


def write_reports(results: Results, options: ReportOptions, annotated: Results | None = None) -> ExitCode:
    """Write `results.json` and all reports, and return the exit code of the call.

    A report that cannot be written does not prevent the others. If it is a required one, every verdict is printed on
    standard output, and the exit code is 1 or higher. The others are best effort.

    If `annotated` is given, only these results get annotations, because the others have been annotated before.
    """
    with suppress(OSError):
        # A script may have removed it.
        output_folder.create_folder(options.folder)
    results = _with_existing_files(results, options)
    annotated = results if annotated is None else _with_existing_files(annotated, options)
    options.room.release()
    unwritten = {}
    for name in (_RESULTS, *_enabled_reports(options)):
        try:
            results = _with_room(name, annotated if name == "annotations" else results, options, results)
        except Exception as error:  # noqa: BLE001 - the fault of one report must not prevent the others
            if name in _PRINTED and isinstance(error, BrokenPipeError):
                # A closed terminal output does not change a verdict.
                continue
            unwritten[name] = error
            # Later reports do not name a file that does not exist.
            options = replace(options, silenced=options.silenced | {name})
    if not unwritten:
        return results.exit_code
    return ExitCode.of_command((results.exit_code, complain_about(unwritten, results, options)))


def _with_existing_files(results: Results, options: ReportOptions) -> Results:
    folder, removed = options.folder, options.room.removed
    outcomes = tuple(with_existing_files(outcome, folder, removed) for outcome in results.outcomes)
    return results.model_copy(update={"outcomes": outcomes})


def _with_room(name: str, written: Results, options: ReportOptions, results: Results) -> Results:
    """Write a report, on a full disk in place of files of runs, if required; return the results that are left."""
    while True:
        try:
            _write(name, written, options)
        except OSError as error:
            stored = ((outcome.trace, outcome.replay, *outcome.recordings) for outcome in results.outcomes)
            if name not in _REQUIRED or not options.room.make(error, filter(None, chain.from_iterable(stored))):
                raise
            results = written = _with_existing_files(results, options)
            if name != _RESULTS:
                # It names no file that was removed.
                with suppress(OSError):
                    _write(_RESULTS, results, options)
        else:
            return results


def _write(name: str, results: Results, options: ReportOptions) -> None:
    if name == _RESULTS:
        results.write(options.folder)
    else:
        REPORTS.load(name)(results, options)


def _created_folder(folder: Path) -> Path:
    try:
        output_folder.create_folder(folder)
    except (OSError, ValueError) as error:
        raise UsageError(escaped_line(f"cannot write to the output folder {folder}: {system_reason(error)}")) from None
    return folder


def _refuse_other_file(junit: Path, folder: Path) -> None:
    """Raise UsageError for a path of another report of this call, or of a scenario file."""
    advice = f"name another file, such as {JUNIT_FILE}"
    for name in (JOURNAL_FILE, RESULTS_FILE, REPORT_FILE):
        if os.path.realpath(junit) == os.path.realpath(folder / name):
            raise UsageError(escaped_line(f"--junit {junit} is the {name} of this call; {advice}"))
    if junit.suffix.lower() in _SCENARIO_SUFFIXES:
        raise UsageError(escaped_line(f"--junit {junit} ends like a scenario file; {advice}"))
    if is_foreign(junit, is_own_junit):
        raise UsageError(
            escaped_line(f"--junit {junit} exists, and sim-action did not write it; {advice}, or remove it")
        )


def _refuse_links(path: Path) -> None:
    """Raise UsageError if a part of a path below the current folder is a link: its author would choose the target."""
    current_folder = Path.cwd()
    absolute = Path(os.path.abspath(path))  # noqa: PTH100 - this looks for links
    if not absolute.is_relative_to(current_folder):
        return
    for place in (absolute, *absolute.parents):
        if place == current_folder:
            return
        if place.is_symlink():
            shown = place.relative_to(current_folder)
            raise UsageError(escaped_line(f"'{shown}' is a link, and results are not written through links; remove it"))


_REQUIRED: Final = frozenset({"results", "junit", "outputs"})
"""The reports that other programs read; without one of them, a call never ends with exit code 0."""

_TARGETS: Final[Mapping[str, tuple[str, Callable[[ReportOptions], Path | str]]]] = MappingProxyType(
    {
        "results": ("results", lambda options: options.folder / RESULTS_FILE),
        "report": ("HTML report", lambda options: options.folder / REPORT_FILE),
        "junit": ("JUnit XML", lambda options: options.junit),
        "summary": ("summary", lambda options: options.environment["GITHUB_STEP_SUMMARY"]),
        "outputs": ("outputs", lambda options: options.environment["GITHUB_OUTPUT"]),
        "terminal": ("report for the terminal", lambda _: "standard output"),
        "annotations": ("annotations", lambda _: "standard output"),
    }
)
"""Name of a report -> its name in messages, and the function that returns its target."""


def complain_about(unwritten: Mapping[str, Exception], results: Results, options: ReportOptions) -> ExitCode:
    """Report why reports are missing, and every verdict if a required one is; return the exit code for it."""
    codes: list[ExitCode] = []
    for name, error in unwritten.items():
        label, target = _TARGETS[name]
        message = f"the {label} cannot be written to {target(options)}"
        if not isinstance(error, (OSError, UnicodeError, MemoryError)):
            codes.append(ExitCode.INTERNAL)
            fault = InternalError.of(error)
            for line in fault.details.splitlines():
                _print(log_line(line), sys.stderr)
            _print(_complaint(f"{message}: {fault}", options.environment), sys.stderr)
        elif name in _REQUIRED:
            codes.append(ExitCode.FAILED)
            _print(_complaint(escaped_line(f"{message}: {system_reason(error)}"), options.environment), sys.stderr)
        else:
            _print(log_line(f"sim-action: warning: {message}: {system_reason(error)}"), sys.stderr)
    if not _REQUIRED.isdisjoint(unwritten):
        text = "\n".join(_verdicts(results))
        # Without standard output, the log of errors is the last place for the verdicts.
        _print(text, sys.stdout) or _print(text, sys.stderr)
    return ExitCode.of_command(codes)


def _complaint(message: str, environment: Mapping[str, str]) -> str:
    if environment.get("GITHUB_ACTIONS") == "true":
        # Without the files of this module, the line is better than nothing.
        with suppress(OSError, ImportError):
            from sim_action.reports.github.annotations import complaint  # a usual run does without it

            return complaint(message, environment)
    return log_line(f"sim-action: {message}")


def _print(text: str, stream: TextIO) -> bool:
    """Print lines, and return False if that is impossible."""
    with suppress(OSError, ValueError):
        stream.write(log_text(text, stream.encoding or "utf-8") + "\n")
        stream.flush()
        return True
    return False


def _verdicts(results: Results) -> Iterator[str]:
    """Yield one line for each scenario and gate: status, name, and the first reason, or the rate if passed."""
    if not results.outcomes:
        yield "there are no verdicts: no scenario was run"
    for group in grouped_scenarios(results.outcomes, results.gates):
        if group.is_part:
            yield log_line(f"{display_of(group.row_status).word}  {one_line(group.name)}  {one_line(group.ending)}")
    for outcome in results.verdicts:
        reason = first_reason(outcome)
        if not reason and outcome.statistics is not None and outcome.expectations:
            reason = outcome.expectations[0].verdict.message
        reason = one_line(reason or ("" if outcome.status == "passed" else " ".join(outcome.notes)))
        parts = (STATUS_DISPLAYS[outcome.status].word, one_line(outcome.name), reason)
        yield log_line("  ".join(part for part in parts if part))
