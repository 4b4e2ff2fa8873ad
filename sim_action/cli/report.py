"""`sim-action report`."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from sim_action.cli.options import refuse_typed, report_flags, report_request
from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.wording import shown
from sim_action.reports import ReportRequest
from sim_action.reports.writing import open_reports, write_reports
from sim_action.results.journal import read_journal


@click.command()
@click.argument("folder", required=False)
@report_flags
def report(folder: str | None, **flags: Any) -> ExitCode:
    """Make all reports from results.jsonl, the journal of a run, also if the run was killed.

    FOLDER is the output folder of the run. The default is the folder of --output-dir. Scenarios without an outcome are
    listed as not finished.

    Exit code: as for `run`; 130 if a scenario has not finished.
    """
    if folder is not None:
        refuse_typed("FOLDER", "output_dir")
        if os.path.isfile(folder):  # noqa: PTH113 - a name that is too long is no file
            near = os.path.dirname(folder) or "."  # noqa: PTH120 - as typed
            raise UsageError(f"expected the output folder of a run, found the file {shown(folder)}; name {shown(near)}")
    # The name of this command is also that of the option --report, whose value is in `flags`.
    request = report_request(flags)
    return report_journal(request if folder is None else replace(request, folder=Path(folder)))


def report_journal(request: ReportRequest) -> ExitCode:
    """Write every report into the folder of the journal, and return the exit code. Raises UsageError."""
    results = read_journal(request.folder).results()
    with open_reports(request, keeps_earlier=True) as options:
        return write_reports(results, options)
