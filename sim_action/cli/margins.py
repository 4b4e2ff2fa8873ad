"""`sim-action margins`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from sim_action.cli.options import (
    ALLOW_OUTSIDE,
    ENGINE_OPTION,
    PACKAGES,
    PATHS,
    SEED_OPTION,
    Bounded,
    code_flags,
    code_permissions,
    discovered,
    jobs_option,
    named_packages,
    not_empty,
    report_flags,
    report_request,
    selection_flags,
)
from sim_action.core.errors import ExitCode
from sim_action.core.records import replace

if TYPE_CHECKING:
    from collections.abc import Sequence


@click.command()
@PATHS
@selection_flags
@click.option(
    "--factor",
    "factors",
    multiple=True,
    callback=not_empty,
    metavar="KEY[=FROM:TO]",
    help="Vary only these factors, such as friction, latency=0 s:2 s or world.objects.box.mass=1 kg:9 kg; repeatable.  "
    "[default: those of --at-least, else all]",
)
@click.option(
    "--at-least",
    "at_least",
    multiple=True,
    callback=not_empty,
    metavar="FACTOR=AMOUNT",
    help="Fail if a scenario fails so near to the nominal value, such as friction=20% or latency=50 ms; repeatable.",
)
@click.option(
    "--runs",
    type=Bounded(click.IntRange(2, 1000)),
    default=20,
    show_default=True,
    metavar="N",
    help="Largest number of runs for each factor, 2 to 1000.",
)
@click.option(
    "--budget",
    type=Bounded(click.IntRange(1)),
    metavar="N",
    help="Vary nothing if there may be more than N runs.  [default: any number]",
)
@click.option(
    "--resume/--no-resume",
    default=False,
    help="Continue the earlier search in the output folder: take over each run that nothing has changed for.  "
    "[default: no]",
)
@click.option("--shard", callback=not_empty, metavar="I/N", help="Only part I of N of the scenarios, such as 1/4.")
@ENGINE_OPTION
@SEED_OPTION
@jobs_option("runs")
@report_flags
@code_flags
@PACKAGES
@ALLOW_OUTSIDE
def margins(
    paths: Sequence[str],
    *,
    factors: tuple[str, ...],
    at_least: tuple[str, ...],
    runs: int,
    budget: int | None,
    resume: bool,
    shard: str | None,
    backend: str | None,
    seed: int | None,
    jobs: int | None,
    packages: tuple[str, ...],
    allow_outside: bool,
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
        from sim_action.runner.run_plan import PlanRequest

        requests = FactorRequest.parsed(factors, at_least)
        suite = discovered(paths, flags, outside=allow_outside)
        allowed = code_permissions(flags, {path.parent: None for path in suite.files})
        permissions = replace(allowed, outside=allow_outside, packages=named_packages(packages))
        reports = report_request(flags)
        request = MarginsRequest(
            PlanRequest(suite, permissions, shard, backend, seed),
            replace(reports, folder=reports.folder / MARGINS_FOLDER),
            jobs or usable_cores(),
            requests,
            runs,
            budget,
            resume,
        )
        return find_margins(request, interruption)[1]
