"""`sim-action compare`."""

from __future__ import annotations

import click

from sim_action.core.errors import ExitCode


@click.command()
@click.argument("old")
@click.argument("new")
@click.option(
    "--margin",
    type=click.FloatRange(0, 1),
    default=0.5,
    show_default=True,
    metavar="SHARE",
    help="Warn if a margin shrinks below this share of its old value.",
)
@click.option(
    "--slower",
    type=click.FloatRange(0, 1),
    default=0.5,
    show_default=True,
    metavar="SHARE",
    help="Warn if a real-time factor drops below this share of its old value.",
)
@click.option("--strict", is_flag=True, help="Treat warnings as failures.")
@click.option(
    "--markdown", metavar="FILE", help="Write the comparison as Markdown for a pull request; - is standard output."
)
@click.option(
    "--summary/--no-summary", default=True, help="On GitHub, add the comparison to the job summary.  [default: yes]"
)
def compare(
    old: str, new: str, *, margin: float, slower: float, strict: bool, markdown: str | None, summary: bool
) -> ExitCode:
    """Show what changed between two runs: new failures, fixed scenarios, shrinking margins.

    OLD and NEW are results.json files, or folders that hold one, or the ones of all shards. Exit code: 0 nothing newly
    fails, 1 a scenario newly fails or is flaky, 2 the results are missing or unreadable.
    """
    from sim_action.app.compare import CompareRequest, compare_results
    from sim_action.results.comparison import Thresholds

    thresholds = Thresholds(margin, slower)
    return compare_results(CompareRequest(old, new, thresholds, strict, markdown, summary))
