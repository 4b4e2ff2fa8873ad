"""`sim-action merge`."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from sim_action.cli.options import discovered, report_flags, report_request, selection_flags, taken_selection
from sim_action.core.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence


@click.command()
@click.argument("results", nargs=-1, required=True, metavar="RESULTS...")
@click.option("--scenarios", multiple=True, metavar="PATHS", help="Scenarios that the results must cover; repeatable.")
@selection_flags
@report_flags
def merge(results: Sequence[str], scenarios: Sequence[str], **flags: Any) -> ExitCode:
    """Join the results of shards into those of one run, and report them.

    RESULTS are results.json files, globs, or folders: every results.json in and below a folder is taken. A missing
    shard, or a scenario of --scenarios without a result, becomes an error among the outcomes. Select scenarios here
    with the same options as for the shards. Exit code: as for `run`.
    """
    from sim_action.app.merge import MergeRequest, merge_results
    from sim_action.core.workspace import Permissions
    from sim_action.results.shard_results import Listing

    selection = taken_selection(flags)
    listing = None
    if scenarios:
        suite = replace(discovered(scenarios), selection=selection)
        if not suite.files:
            raise UsageError(
                "--scenarios finds no scenario; run merge in the checked-out repository, in the folder of the shards"
            )
        listing = Listing(suite.scenarios(Permissions()), suite.empty)
    return merge_results(MergeRequest(results, listing, report_request(flags)))
