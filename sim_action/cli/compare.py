"""`sim-action compare`."""

from __future__ import annotations

import click

from sim_action.cli.options import Bounded
from sim_action.core.errors import ExitCode


@click.command(short_help="Compare two runs.")
@click.argument("old")
@click.argument("new")
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
@click.option("--strict", is_flag=True, help="Treat warnings as failures.")
@click.option("--allow-removed", is_flag=True, help="Accept a new run that has no scenario of the old run.")
@click.option(
    "--markdown",
    metavar="FILE",
    help="Write the comparison as Markdown, such as for a comment on a pull request; - is standard output.",
)
@click.option(
    "--summary/--no-summary", default=True, help="On GitHub, add the comparison to the job summary.  [default: yes]"
)
def compare(
    old: str,
    new: str,
    *,
    margin: float,
    slower: float,
    strict: bool,
    allow_removed: bool,
    markdown: str | None,
    summary: bool,
) -> ExitCode:
    """Compare two runs: new failures, fixed scenarios, weaker checks, smaller margins.

    OLD and NEW are results.json files, or folders. A folder contains one results.json, or the results.json files of all
    shards.

    Exit code: 0 no scenario newly fails; 1 a scenario newly fails or is flaky, or every scenario was removed; 2 the
    results are missing or unreadable, or the command line is invalid; 3 internal error of sim-action.
    """
    from sim_action.app.compare import CompareRequest, compare_results
    from sim_action.results.comparison import Thresholds

    thresholds = Thresholds(margin, slower)
    return compare_results(CompareRequest(old, new, thresholds, strict, markdown, summary, allow_removed))
