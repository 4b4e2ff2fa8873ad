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
@click.option("--scenarios", multiple=True, metavar="PATHS", help="What has to be in the results; may be repeated.")
@selection_flags
@report_flags
def merge(results: Sequence[str], scenarios: Sequence[str], **flags: Any) -> ExitCode:
    """Join the results of shards to those of one run, and report them.

    RESULTS are results.json files, folders (every one in and below them) or globs. A shard that has left none, or a
    scenario of --scenarios that none has, is an error among the outcomes; what was selected for the shards is to be
    selected of these, too. Exit code: as of `run`.
    """
    from sim_action.app import merge as merging
    from sim_action.core.workspace import Permissions
    from sim_action.results.shard_results import Listing

    selection = taken_selection(flags)
    listing = None
    if scenarios:
        suite = replace(discovered(scenarios), selection=selection)
        if not suite.files:
            raise UsageError("--scenarios finds none; is this where the shards ran, with the repository checked out?")
        listing = Listing(suite.scenarios(Permissions()), suite.empty)
    return merging.merge(merging.MergeRequest(results, listing, report_request(flags)))
