"""`sim-action margins`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import click

from sim_action.cli import options
from sim_action.core.errors import ExitCode
from sim_action.core.records import replace


@click.command()
@options.PATHS
@options.selection_flags
@options.text_option(
    "--factor",
    "factors",
    metavar="KEY[=FROM:TO]",
    text="Vary only these factors, such as friction, latency=0 s:2 s or world.objects.box.mass=1 kg:9 kg; repeatable.  "
    "[default: those of --at-least, else all]",
    multiple=True,
)
@options.text_option(
    "--at-least",
    "at_least",
    metavar="FACTOR=AMOUNT",
    text="Fail if a scenario fails so near to the nominal value, such as friction=20% or latency=50 ms; repeatable.",
    multiple=True,
)
@click.option(
    "--runs",
    type=options.Bounded(click.IntRange(2, 1000)),
    default=20,
    show_default=True,
    metavar="N",
    help="Largest number of runs for each factor, 2 to 1000.",
)
@click.option(
    "--budget",
    type=options.Bounded(click.IntRange(1)),
    metavar="N",
    help="Vary nothing if there may be more than N runs.  [default: any number]",
)
@options.switch(
    "resume", "Continue the earlier search in the output folder: take over each run that nothing has changed for."
)
@options.text_option("--shard", metavar="I/N", text="Only part I of N of the scenarios, such as 1/4.")
@options.ENGINE_OPTION
@options.SEED_OPTION
@options.jobs_option("runs")
@options.report_flags
@options.code_flags
@options.PACKAGES
@options.ALLOW_OUTSIDE
def margins(
    paths: Sequence[str],
    *,
    factors: tuple[str, ...],
    at_least: tuple[str, ...],
    runs: int,
    budget: int | None,
    resume: bool,
    jobs: int | None,
    **flags: Any,
) -> ExitCode:
    """Find how far each factor of a scenario can move before the scenario fails.

    PATHS are as for "run". Each factor varies alone, in both directions; bisection finds where the scenario begins to
    fail. Reports are in the folder margins below --output-dir. Only the first variation of a scenario is varied.

    Exit code: 0 every scenario passes and has the margins of --at-least; 1 one does not; others as of "run".
    """
    from sim_action.core.process import Interruption, usable_cores

    with Interruption() as interruption:
        from sim_action.app.margins import MARGINS_FOLDER, MarginsRequest, find_margins
        from sim_action.runner.margin_search import FactorRequest

        requests = FactorRequest.parsed(factors, at_least)
        plan = options.plan_request(paths, flags)
        reports = options.report_request(flags)
        request = MarginsRequest(
            plan,
            replace(reports, folder=reports.folder / MARGINS_FOLDER),
            jobs or usable_cores(),
            requests,
            runs,
            budget,
            resume,
        )
        return find_margins(request, interruption)[1]
