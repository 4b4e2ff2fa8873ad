"""`sim-action compare`."""

from __future__ import annotations

import click

from sim_action.cli.options import Bounded, not_empty, output_dir, refuse_typed
from sim_action.core.errors import ExitCode


@click.command(short_help="Compare two runs.")
@click.argument("old")
@click.argument("new", required=False)
@output_dir("Folder of the new results if NEW is not given.")
@click.option(
    "--margin",
    type=Bounded(click.FloatRange(0, 1)),
    default=0.5,
    show_default=True,
    metavar="SHARE",
    help="Warn if a margin, the distance between measured value and limit, shrinks below this share (0 to 1) of its "
    "old value.",
)
@click.option(
    "--slower",
    type=Bounded(click.FloatRange(0, 1)),
    default=0.5,
    show_default=True,
    metavar="SHARE",
    help="Warn if the real-time factor, sim time divided by real time, drops below this share (0 to 1) of its old "
    "value.",
)
@click.option("--strict/--no-strict", default=False, help="Treat warnings as failures.  [default: no]")
@click.option(
    "--allow-removed/--no-allow-removed",
    default=False,
    help="Accept a new run that has no scenario of the old run.  [default: no]",
)
@click.option(
    "--markdown",
    callback=not_empty,
    metavar="FILE",
    help="Write the comparison as Markdown, such as for a comment on a pull request; - is standard output.",
)
@click.option(
    "--summary/--no-summary",
    envvar="SIM_ACTION_SUMMARY",
    default=True,
    help="On GitHub, add the comparison to the job summary.  [default: yes]",
)
def compare(
    old: str,
    new: str | None,
    *,
    output_dir: str,
    margin: float,
    slower: float,
    strict: bool,
    allow_removed: bool,
    markdown: str | None,
    summary: bool,
) -> ExitCode:
    """Compare two runs: new failures, fixed scenarios, weaker checks, smaller margins.

    OLD and NEW are results.json files, or folders. A folder contains one results.json, or the results.json files of all
    shards. The default of NEW is the folder of --output-dir. Runs of a gate are compared in pairs with the same draws.

    Exit code: 0 no scenario newly fails; 1 a scenario newly fails or is flaky, the pass rate of a gate fell
    significantly, or every scenario was removed; 2 the results are missing or unreadable, or the command line is
    invalid; 3 internal error of sim-action.
    """
    from sim_action.app.compare import CompareRequest, compare_results
    from sim_action.results.comparison import Thresholds

    if new is not None:
        refuse_typed("NEW", "output_dir")
    thresholds = Thresholds(margin, slower)
    return compare_results(CompareRequest(old, new or output_dir, thresholds, strict, markdown, summary, allow_removed))
