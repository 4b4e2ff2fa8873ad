"""`sim-action view`."""

from __future__ import annotations

import click

from sim_action.cli.bounds import Bounded
from sim_action.cli.options import output_dir, refuse_typed


@click.command(short_help="Open a report in the browser.")
@click.argument("report", required=False)
@output_dir("Folder of the results if REPORT is not given.")
@click.option("--only", metavar="NAME", help="Open the report at this scenario.")
@click.option(
    "--time",
    type=Bounded(click.FloatRange(min=0)),
    metavar="T",
    help="Open the report at this sim time in s; needs --only.",
)
@click.option("--print", "print_only", is_flag=True, help="Print the URL of the report instead of opening it.")
def view(report: str | None, *, output_dir: str, only: str | None, time: float | None, print_only: bool) -> None:
    """Open the report of a run in the browser.

    REPORT is a report.html, its results.json, or the folder of both. The default is the folder of --output-dir.
    """
    from pathlib import Path

    from sim_action.app.view import ViewRequest, view_report

    if report is not None:
        refuse_typed("REPORT", "output_dir")
    view_report(ViewRequest(Path(report or output_dir), only, time), print_only=print_only)
