"""`sim-action view`."""

from __future__ import annotations

import click


@click.command()
@click.argument("report", required=False)
@click.option(
    "--output-dir",
    envvar="SIM_ACTION_OUTPUT_DIR",
    default="sim-results",
    show_default=True,
    help="Where results are, if no report is named.",
)
@click.option("--only", metavar="NAME", help="Open it at this scenario.")
@click.option("--time", type=click.FloatRange(min=0), metavar="T", help="And at this sim time, in s.")
@click.option("--print", "print_only", is_flag=True, help="Print its address, and open nothing.")
def view(report: str | None, *, output_dir: str, only: str | None, time: float | None, print_only: bool) -> None:
    """Open the report of a run in the browser.

    REPORT is a report.html, the results.json beside it, or their folder.
    """
    from pathlib import Path

    from sim_action.app import view as viewing

    viewing.view(viewing.ViewRequest(Path(report or output_dir), only, time), print_only=print_only)
