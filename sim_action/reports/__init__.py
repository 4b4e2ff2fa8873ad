"""Reports: the table of all reports, their options, and writing them.

`terminal`, `junit`, `github` and `html` hold the reports of a run; `comparison` holds that of `sim-action compare`.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterator, Mapping
from collections.abc import Set as AbstractSet
from contextlib import contextmanager, suppress
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, Literal, Protocol

from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.permissions import Permissions
from sim_action.core.records import dataclass, replace
from sim_action.core.registry import Table
from sim_action.core.wording import escaped_line, system_reason
from sim_action.results.artifacts import REPORT_FILE, RUN_FILE_FOLDERS, with_existing_files
from sim_action.results.journal import JOURNAL_FILE, manifest
from sim_action.results.output_folder import (
    create_folder,
    locked,
    remove_earlier_files,
    remove_regular,
    remove_unfinished_files,
)
from sim_action.results.results_json import RESULTS_FILE, Results
from sim_action.results.written_files import JUNIT_FILE, is_foreign, is_own_junit, refuse_foreign_files

if TYPE_CHECKING:
    from sim_action.results.earlier_run import EarlierRun

Verbosity = Literal["quiet", "normal", "verbose"]
"""The amount of text on the terminal.

- quiet: only failures and one closing line.
- verbose: also notes, messages of the engine and the output of controllers.
"""


_NO_PERMISSIONS: Final = Permissions()


@dataclass(frozen=True, slots=True)
class ReportOptions:
    """The targets and options of reports.

    Attributes:
        folder: the existing output folder, with `results.json`.
        junit: the path of the JUnit XML.
        junit_strict: True to omit everything that the Jenkins schema `junit-10.xsd` forbids.
        environment: the environment variables; GitHub names its files there (`GITHUB_STEP_SUMMARY`, ...).
        workspace: the folder to which paths in reports are relative.
        verbosity: the amount of text on the terminal.
        silenced: the names of reports that are not written.
        taken_over: the number of outcomes of an earlier call, see `run --resume`; None: it was not asked for.
        permissions: what the caller permits; the command that runs a scenario again permits the same.
        against: the earlier run that `report.html` compares with; None: there is none.
    """

    folder: Path
    junit: Path
    junit_strict: bool
    environment: Mapping[str, str]
    workspace: Path
    verbosity: Verbosity = "normal"
    silenced: frozenset[str] = frozenset()
    taken_over: int | None = None
    permissions: Permissions = _NO_PERMISSIONS
    against: EarlierRun | None = None

    @property
    def files(self) -> tuple[str, ...]:
        """The files of a call in the output folder, apart from those of its runs."""
        junit = Path(os.path.relpath(self.junit, self.folder))
        return (JOURNAL_FILE, RESULTS_FILE, REPORT_FILE, *(() if ".." in junit.parts else (junit.as_posix(),)))


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

_WORKSPACES: Final = MappingProxyType(
    {
        "GITHUB_WORKSPACE": ("GITHUB_WORKSPACE",),
        "CI_PROJECT_DIR": ("CI_PROJECT_DIR",),
        # Other programs have a variable of this name, too.
        "WORKSPACE": ("JENKINS_URL", "JENKINS_HOME", "BUILD_TAG"),
    }
)
"""Variable with the workspace of a CI service -> variables of which one must be set for it to count."""

_SCENARIO_SUFFIXES: Final = frozenset({".yml", ".yaml"})
_RESULTS: Final = "results"
_PRINTED: Final = frozenset({"terminal", "annotations"})
_UNWRITTEN: Final = "sim_action.reports.unwritten_reports"


@dataclass(frozen=True, slots=True)
class ReportRequest:
    """The report options of the command line.

    Attributes:
        silenced: the names of reports that are switched off.
        against: the results of an earlier run, as typed; None: `report.html` compares with nothing.
    """

    folder: Path
    junit: Path | None
    junit_strict: bool
    verbosity: Verbosity
    silenced: frozenset[str]
    against: str | None = None


@contextmanager
def open_reports(request: ReportRequest, *, keeps_earlier: bool = False) -> Iterator[ReportOptions]:
    """Open the output folder for one call until its reports are written, and yield the options of the reports.

    The folder is created and locked. Unless `keeps_earlier`, the files of the earlier call are removed: a call that is
    killed must not leave reports that are not its own. Raises UsageError.
    """
    # At the end there may be no descriptor left for an import.
    importlib.import_module(_UNWRITTEN)
    _check_targets(request)
    # Before anything is removed or run: the results of the earlier run may not be there.
    against = None if request.against is None else _earlier_run(request.against, request.folder)
    folder = _created_folder(request.folder)
    with locked(folder):
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
        )


def _earlier_run(pattern: str, folder: Path) -> EarlierRun:
    """Return the run to compare with. Raise UsageError, also for the results that this call overwrites."""
    from sim_action.results.earlier_run import read_run

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


def workspace_of(environment: Mapping[str, str], here: Path) -> Path:
    """Return the folder to which paths in reports are relative: that of the CI service, else the current folder.

    A variable may come from another machine, or from another program. A value that is no absolute path of an existing
    folder does not count; the repository above the current folder does then.
    """
    stated = [environment.get(name, "") for name, marks in _WORKSPACES.items() if any(map(environment.get, marks))]
    for name in filter(None, stated):
        with suppress(OSError, ValueError):
            if Path(name).is_absolute() and Path(name).is_dir():
                return Path(name)
    above = (folder for folder in (here, *here.parents) if (folder / ".git").exists())
    return next(above, here) if any(stated) else here


def _check_targets(request: ReportRequest) -> None:
    """Raise UsageError if a report must not be written to its place, or the place cannot be looked at."""
    junit = request.junit
    try:
        for place in (*(request.folder / name for name in RUN_FILE_FOLDERS), *([junit.parent] if junit else [])):
            _refuse_links(place)
        if junit is not None:
            _refuse_special_file(junit)
            _refuse_other_file(junit, request.folder)
        refuse_foreign_files(request.folder)
    except (OSError, ValueError) as error:
        where = (
            f"--output-dir {request.folder}" if junit is None else f"--output-dir {request.folder} or --junit {junit}"
        )
        raise UsageError(escaped_line(f"{where} cannot be used: {system_reason(error)}")) from None


def remove_earlier(request: ReportRequest, kept: AbstractSet[str] = frozenset()) -> None:
    """Remove the files of the earlier call in the output folder, apart from those named in `kept`."""
    remove_earlier_files(request.folder, set(manifest(request.folder)) - kept)
    remove_unfinished_files(request.folder)
    if request.junit is not None:
        with suppress(OSError):
            remove_regular(request.junit)


def make_ready(options: ReportOptions) -> None:
    """Import the modules of all reports in advance, while the process waits for something else.

    The imports take a tenth of the time of a short run. They need files, which a report of a fault may lack.
    """
    # An import that fails now may succeed later; otherwise it is reported as the fault of its report.
    with suppress(OSError, ImportError):
        for name in _enabled_reports(options):
            REPORTS.load(name)


def _enabled_reports(options: ReportOptions) -> list[str]:
    return [name for name in REPORTS if name not in options.silenced and _has_reader(name, options.environment)]


def _has_reader(name: str, environment: Mapping[str, str]) -> bool:
    return name not in _VARIABLES or bool(environment.get(_VARIABLES[name]))


def write_reports(results: Results, options: ReportOptions, annotated: Results | None = None) -> ExitCode:
    """Write `results.json` and all reports, and return the exit code of the call.

    A report that cannot be written does not prevent the others. If it is a required one, every verdict is printed on
    standard output, and the exit code is 1 or higher. The others are best effort.

    If `annotated` is given, only these results get annotations, because the others have been annotated before.
    """
    with suppress(OSError):
        # A script may have removed it.
        create_folder(options.folder)
    results = _with_existing_files(results, options.folder)
    annotated = results if annotated is None else _with_existing_files(annotated, options.folder)
    unwritten = {}
    for name in (_RESULTS, *_enabled_reports(options)):
        try:
            _write(name, annotated if name == "annotations" else results, options)
        except Exception as error:  # noqa: BLE001 - the fault of one report must not prevent the others
            if name in _PRINTED and isinstance(error, BrokenPipeError):
                # A closed terminal output does not change a verdict.
                continue
            unwritten[name] = error
            # Later reports do not name a file that does not exist.
            options = replace(options, silenced=options.silenced | {name})
    if not unwritten:
        return results.exit_code
    from sim_action.reports.unwritten_reports import complain_about

    return ExitCode.of_command((results.exit_code, complain_about(unwritten, results, options)))


def _with_existing_files(results: Results, folder: Path) -> Results:
    return results.model_copy(
        update={"outcomes": tuple(with_existing_files(outcome, folder) for outcome in results.outcomes)}
    )


def _write(name: str, results: Results, options: ReportOptions) -> None:
    if name == _RESULTS:
        results.write(options.folder)
    else:
        REPORTS.load(name)(results, options)


def _created_folder(folder: Path) -> Path:
    try:
        create_folder(folder)
    except (OSError, ValueError) as error:
        raise UsageError(escaped_line(f"cannot write to the output folder {folder}: {system_reason(error)}")) from None
    return folder


def _refuse_special_file(junit: Path) -> None:
    """Raise UsageError for a path that a file cannot replace, or must not: a folder, a pipe or a device."""
    if junit.is_dir():
        raise UsageError(escaped_line(f"--junit {junit} is a folder; name a file"))
    if junit.exists() and not junit.is_file():
        raise UsageError(escaped_line(f"--junit {junit} is not a regular file; name a file"))


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
    here = Path.cwd()
    absolute = Path(os.path.abspath(path))  # noqa: PTH100 - links are what is looked for
    if not absolute.is_relative_to(here):
        return
    for place in (absolute, *absolute.parents):
        if place == here:
            return
        if place.is_symlink():
            shown = place.relative_to(here)
            raise UsageError(escaped_line(f"'{shown}' is a link, and results are not written through links; remove it"))
