"""Reports: what people and tools get to read of the results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, Protocol

from sim_action.core.registry import Table
from sim_action.results.file import Results

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
        "report": "sim_action.reports.html:write_html",
        "junit": "sim_action.reports.junit:write_junit",
        "summary": "sim_action.reports.summary:write_summary",
        "outputs": "sim_action.reports.outputs:write_outputs",
        "terminal": "sim_action.reports.terminal:print_results",
        "annotations": "sim_action.reports.annotations:write_annotations",
    },
)
"""In the order in which they are written: files first, since whoever reads the output may have gone."""
