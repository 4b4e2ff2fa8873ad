"""`sim-action view`."""

from __future__ import annotations

from pathlib import Path

import click

from sim_action.app.view import view_report
from sim_action.cli.options import PORT, Bounded, flag, live_port, output_dir, refuse_typed
from sim_action.core.errors import ExitCode


@click.command()
@click.argument("report", required=False)
@output_dir("Folder of the results if REPORT is not given.")
@click.option("--only", metavar="NAME", help="Open the report at this scenario.")
@click.option(
    "--time",
    type=Bounded(click.FloatRange(min=0)),
    metavar="T",
    help="Open the report at this sim time in s; needs --only.",
)
@flag("--print", "print_only", text="Print the URL of the report instead of opening it.")
@flag(
    "--live",
    text="Show the progress of the run in the folder while it goes on, and a report of finished scenarios, until "
    "Ctrl-C. Only this machine can open the URL.",
)
@PORT
def view(
    report: str | None,
    *,
    output_dir: str,
    only: str | None,
    time: float | None,
    print_only: bool,
    live: bool,
    port: int,
) -> ExitCode:
    """Open the report of a run in the browser.

    REPORT is a report.html, its results.json, or the folder of both. The default is the folder of --output-dir.
    """
    if report is not None:
        refuse_typed("REPORT", "output_dir")
    place = Path(report or output_dir)
    served = live_port(live=live, port=port)
    if served is not None:
        from sim_action.app.live import serve_live

        refuse_typed("--live", "only", "time")
        return serve_live(place, served, print_only=print_only)
    view_report(place, only, time, print_only=print_only)
    return ExitCode.PASSED
