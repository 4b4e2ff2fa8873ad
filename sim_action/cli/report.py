"""`sim-action report`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from sim_action.cli.options import flag, refuse_typed, report_flags, report_request
from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.wording import counted, escaped_line, log_line, shown, system_reason
from sim_action.reports import ReportRequest
from sim_action.reports.writing import open_reports, write_reports
from sim_action.results.journal import read_journal
from sim_action.results.output_folder import create_folder


@click.command()
@click.argument("folders", nargs=-1, metavar="[FOLDER]...")
@flag(
    "--history",
    text="Write history.html instead: the margin of each expectation over all runs, and the first commit that broke "
    "it. Each FOLDER has a results.json, or a folder for each run.",
)
@report_flags
def report(folders: tuple[str, ...], *, history: bool, **flags: Any) -> ExitCode:
    """Make all reports from results.jsonl, the journal of a run, also if the run was killed.

    FOLDER is the output folder of the run. The default is the folder of --output-dir. Scenarios without an outcome are
    listed as not finished.

    Exit code: as for `run`; 130 if a scenario has not finished. With --history: 0.
    """
    if history:
        return _history(folders or (flags["output_dir"],), Path(flags["output_dir"]))
    if len(folders) > 1:
        raise UsageError(f"found {len(folders)} folders; name one, or add --history to compare their runs")
    folder = next(iter(folders), None)
    if folder is not None:
        refuse_typed("FOLDER", "output_dir")
        if os.path.isfile(folder):  # noqa: PTH113 - a name that is too long is no file
            near = os.path.dirname(folder) or "."  # noqa: PTH120 - as typed
            raise UsageError(f"expected the output folder of a run, found the file {shown(folder)}; name {shown(near)}")
    # This command and the option --report have the same name; `flags` has the value of the option.
    request = report_request(flags)
    return report_journal(request if folder is None else replace(request, folder=Path(folder)))


def _history(places: Sequence[str], folder: Path) -> ExitCode:
    """Write the page; print its path and the broken expectations. Raise UsageError."""
    from sim_action.reports.html.history_page import HISTORY_FILE, read_runs, write_history  # the reports do without

    runs = read_runs(places)
    try:
        create_folder(folder)
        broken = write_history(runs, folder)
    except (OSError, ValueError) as error:
        raise UsageError(escaped_line(f"cannot write to {folder}: {system_reason(error)}")) from None
    for line in broken:
        click.echo(log_line(line))
    click.echo(log_line(f"history of {counted(len(runs), 'run')}: {folder / HISTORY_FILE}"))
    return ExitCode.PASSED


def report_journal(request: ReportRequest) -> ExitCode:
    """Write every report into the folder of the journal, and return the exit code. Raises UsageError."""
    results = read_journal(request.folder).results()
    with open_reports(request, keeps_earlier=True) as options:
        return write_reports(results, options)
