"""`sim-action merge`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from sim_action.cli.options import (
    discovered,
    not_empty,
    report_flags,
    report_request,
    selection_flags,
    taken_selection,
    typed,
)
from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.records import replace

if TYPE_CHECKING:
    from collections.abc import Sequence


@click.command(short_help="Join the results of shards.")
@click.argument("results", nargs=-1, required=True, metavar="RESULTS...")
@click.option(
    "--scenarios",
    multiple=True,
    callback=not_empty,
    metavar="PATH",
    help="A scenario file, folder or glob: the results must cover these scenarios; repeatable.",
)
@selection_flags
@report_flags
def merge(results: Sequence[str], scenarios: Sequence[str], **flags: Any) -> ExitCode:
    """Join the results of shards, and report them like one run.

    RESULTS are results.json files, globs, or folders. A folder stands for every results.json in it and below. If a
    shard is missing, or a scenario of --scenarios has no result, the joined results contain an error for it. Select
    scenarios here with the same options as for the shards.

    Exit code: as for `run`.
    """
    from sim_action.app.merge import MergeRequest, merge_results
    from sim_action.core.permissions import Permissions
    from sim_action.results.shard_results import Listing

    if not scenarios and (selecting := typed("only", "exclude", "tags", "exclude_tags")):
        needs = "needs" if len(selecting) == 1 else "need"
        raise UsageError(f"{', '.join(selecting)} {needs} --scenarios, the scenarios to select from")
    selection = taken_selection(flags)
    listing = None
    if scenarios:
        suite = replace(discovered(scenarios), selection=selection)
        if not suite.files:
            raise UsageError(
                "--scenarios finds no scenario; run merge in the checked-out repository, in the folder of the shards"
            )
        contents = suite.read(Permissions())
        listing = Listing(suite.numbered_in(contents), suite.empty, contents.unmatched)
    return merge_results(MergeRequest(results, listing, report_request(flags)))
