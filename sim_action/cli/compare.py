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
    help="Warn of margins that are less than this share of what they were.",
)
@click.option(
    "--slower",
    type=click.FloatRange(0, 1),
    default=0.5,
    show_default=True,
    metavar="SHARE",
    help="Warn of real-time factors that are, likewise.",
)
@click.option("--strict", is_flag=True, help="Warnings fail, too.")
@click.option("--markdown", metavar="FILE", help="Write it as Markdown for a pull request; -: to standard output.")
@click.option("--summary/--no-summary", default=True, help="Add it to the job summary, on GitHub.  [default: yes]")
def compare(
    old: str, new: str, *, margin: float, slower: float, strict: bool, markdown: str | None, summary: bool
) -> ExitCode:
    """Tell what has changed between two runs: what newly fails, was mended, came nearer to its limit.

    OLD and NEW are results.json files, or folders with one or with those of all shards. Exit code: 0 nothing newly
    fails, 1 a scenario newly fails or is flaky, 2 there are no results, or none that can be read.
    """
    from sim_action.app import compare as comparing
    from sim_action.results.comparison import Thresholds

    thresholds = Thresholds(margin, slower)
    return comparing.compare(comparing.CompareRequest(old, new, thresholds, strict, markdown, summary))
