"""Reports: the table of all reports, their options, and writing them.

`terminal`, `junit`, `github` and `html` hold the reports of a run; `comparison` holds that of `sim-action compare`.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Final, Literal, Protocol

from sim_action.core.errors import UsageError
from sim_action.core.registry import Table
from sim_action.core.wording import escaped_line
from sim_action.results.artifacts import RUN_FILE_FOLDERS
from sim_action.results.results_json import Results

Verbosity = Literal["quiet", "normal", "verbose"]
"""The amount of text on the terminal.

- quiet: only failures and one closing line.
- verbose: also notes, messages of the engine and the output of controllers.
"""


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
    """

    folder: Path
    junit: Path
    junit_strict: bool
    environment: Mapping[str, str]
    workspace: Path
    verbosity: Verbosity = "normal"
    silenced: frozenset[str] = frozenset()


class Report(Protocol):
    """The function that writes one report."""

    def __call__(self, results: Results, options: ReportOptions) -> None:
        """Write the report, if its target exists."""


REPORTS: Final = Table[Report](
    "report",
    {
        "report": "sim_action.reports.html.report:write_html",
        "junit": "sim_action.reports.junit:write_junit",
        "summary": "sim_action.reports.github.job_summary:write_summary",
        "outputs": "sim_action.reports.github.step_outputs:write_outputs",
        "terminal": "sim_action.reports.terminal:print_results",
        "annotations": "sim_action.reports.github.annotations:write_annotations",
    },
)
"""The reports in the order of writing: files first, because the reader of the terminal output may have closed it."""

_VARIABLES: Final = MappingProxyType(
    {"summary": "GITHUB_STEP_SUMMARY", "outputs": "GITHUB_OUTPUT", "annotations": "GITHUB_ACTIONS"}
)
"""Name of a report that only GitHub reads -> the variable that GitHub sets for it. Elsewhere it is not imported."""


@dataclass(frozen=True, slots=True)
class ReportRequest:
    """The report options of the command line; `silenced` holds the names of reports that are switched off."""

    folder: Path
    junit: Path | None
    junit_strict: bool
    verbosity: Verbosity
    silenced: frozenset[str]


def report_options(request: ReportRequest) -> ReportOptions:
    """Return the options of the reports and create the output folder. Raises UsageError."""
    for place in (
        *(request.folder / name for name in RUN_FILE_FOLDERS),
        *([request.junit.parent] if request.junit else []),
    ):
        _refuse_links(place)
    folder = _created_folder(request.folder)
    if request.junit is not None and request.junit.is_dir():
        raise UsageError(f"--junit {request.junit} is a folder; name a file")
    return ReportOptions(
        folder=folder,
        junit=request.junit or folder / "junit.xml",
        junit_strict=request.junit_strict,
        environment=os.environ,
        workspace=Path(os.environ.get("GITHUB_WORKSPACE") or Path.cwd()),
        verbosity=request.verbosity,
        silenced=request.silenced,
    )


def make_ready(options: ReportOptions) -> None:
    """Import the modules of all reports in advance, while the process waits for something else.

    The imports take a tenth of the time of a short run.
    """
    for name in _enabled_reports(options):
        REPORTS.load(name)


def _enabled_reports(options: ReportOptions) -> list[str]:
    return [name for name in REPORTS if name not in options.silenced and _has_reader(name, options.environment)]


def _has_reader(name: str, environment: Mapping[str, str]) -> bool:
    return name not in _VARIABLES or bool(environment.get(_VARIABLES[name]))


def write_reports(results: Results, options: ReportOptions, annotated: Results | None = None) -> None:
    """Write `results.json` and all reports. Raises UsageError at the end if some could not be written.

    If `annotated` is given, only these results get annotations, because the others have been annotated before.
    """
    failed = []
    of = {"annotations": results if annotated is None else annotated}
    writers = {"results": lambda: results.write(options.folder)} | {
        name: partial(REPORTS.load(name), of.get(name, results), options) for name in _enabled_reports(options)
    }
    for name, write in writers.items():
        try:
            write()
        except BrokenPipeError:
            # A closed terminal output does not change a verdict.
            continue
        except OSError as error:
            failed.append(f"the {name} report cannot be written: {error.filename or name}: {error.strerror}")
    if failed:
        raise UsageError("; ".join(failed))


def _created_folder(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"cannot write to the output folder {folder}: {error.strerror}") from None
    return folder


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
