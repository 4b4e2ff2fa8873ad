"""Reports: what people and tools get to read of the results."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final, Literal, Protocol

from sim_action.core.errors import UsageError
from sim_action.core.messages import escaped_line
from sim_action.core.registry import Table
from sim_action.results.results_json import Results
from sim_action.results.stored_files import RUN_FILE_FOLDERS

Verbosity = Literal["quiet", "normal", "verbose"]
"""quiet: what failed, and one closing line; verbose: also notes, diagnostics and what controllers printed."""


@dataclass(frozen=True, slots=True)
class ReportOptions:
    """Where reports go.

    Attributes:
        folder: the output folder; it exists, and holds `results.json`.
        junit: where the JUnit XML goes.
        junit_strict: leave out what the Jenkins schema `junit-10.xsd` forbids.
        environment: where GitHub says which files it reads (`GITHUB_STEP_SUMMARY`, `GITHUB_OUTPUT`, ...).
        workspace: paths in reports are seen from here.
        verbosity: how much the terminal shows.
        silenced: names of reports that are not written.
    """

    folder: Path
    junit: Path
    junit_strict: bool
    environment: Mapping[str, str]
    workspace: Path
    verbosity: Verbosity = "normal"
    silenced: frozenset[str] = frozenset()


class Report(Protocol):
    """What the table's entries are."""

    def __call__(self, results: Results, options: ReportOptions) -> None:
        """Writes the report, if its place is given."""


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
"""In the order in which they are written: files first, since whoever reads the output may have gone."""


@dataclass(frozen=True, slots=True)
class ReportRequest:
    """What the command line asks for, as it was typed; `silenced`: names of reports that are not wanted."""

    folder: Path
    junit: Path | None
    junit_strict: bool
    verbosity: Verbosity
    silenced: frozenset[str]


def report_options(request: ReportRequest) -> ReportOptions:
    """Where reports go; makes the output folder. Raises UsageError."""
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
    """Imports what reports are written with, which takes a tenth of a short run: for whoever has to wait anyway."""
    for name in _enabled_reports(options):
        REPORTS.load(name)


def _enabled_reports(options: ReportOptions) -> list[str]:
    return [name for name in REPORTS if name not in options.silenced]


def write_reports(results: Results, options: ReportOptions, annotated: Results | None = None) -> None:
    """Writes what can be written; raises UsageError for the rest.

    Annotations are of `annotated` alone, if it is given: somebody else has annotated the others.
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
            # Whoever read the output has gone; that changes no verdict.
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
    """Raises UsageError if a folder of a path below the current one is a link: whoever wrote it chose the target."""
    here = Path.cwd()
    absolute = Path(os.path.abspath(path))  # noqa: PTH100 - links are what is looked for
    if not absolute.is_relative_to(here):
        return
    for place in (absolute, *absolute.parents):
        if place == here:
            return
        if place.is_symlink():
            shown = place.relative_to(here)
            raise UsageError(escaped_line(f"'{shown}' is a link: results are not written through one; remove it"))
