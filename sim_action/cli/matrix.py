"""`sim-action matrix`."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import click

from sim_action.cli.options import PATHS, Bounded, discovered, not_empty, selection_flags
from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.wording import note

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sim_action.app.matrix import FileOfScenarios
    from sim_action.scenario.selection import Suite


@click.command(short_help="Split scenarios into shards.")
@PATHS
@selection_flags
@click.option(
    "--shards",
    type=Bounded(click.IntRange(min=1, max=256)),
    metavar="N",
    required=True,
    help="Number of shards, 1 to 256. If there are fewer scenarios, there are fewer shards.",
)
@click.option(
    "--durations",
    callback=not_empty,
    metavar="FILE",
    help="The results.json of an earlier run: shards get about the same total duration. Without it, all scenarios "
    "count the same.",
)
def matrix(paths: Sequence[str], shards: int, durations: str | None, **flags: Any) -> ExitCode:
    """Split scenarios into shards of similar duration, which parallel jobs run.

    The shards are printed as JSON, for the matrix of a GitHub job.

    PATHS are scenario files, globs, or folders. A folder stands for every *.sim.yml and *.sim.yaml in it and below. The
    default is the current folder.

    Exit code: 0 scenarios found; 2 a scenario file or the command line is invalid; 3 internal error of sim-action; 5 no
    scenario found.
    """
    from pathlib import Path

    from sim_action.app.matrix import Unit, known_durations, matrix_text
    from sim_action.results.results_json import Results

    suite = discovered(paths, flags)
    if not suite.files:
        return ExitCode.of_command(has_scenarios=False)
    known: dict[Unit, float] = {}
    try:
        if durations and os.path.lexists(durations):
            known = known_durations(Results.read(Path(durations)))
        elif durations:
            note(
                f"there are no earlier results at {durations}, as in the first run; all scenarios count as equally long"
            )
    except UsageError as error:
        note(f"{error}; all scenarios count as equally long")
    click.echo(matrix_text(_files(suite), suite.empty, shards, known))
    return ExitCode.PASSED


def _files(suite: Suite) -> list[FileOfScenarios]:
    """Return the files of which at least one scenario is selected. Raises UsageError.

    With several patterns or tags, a shard need not have a scenario for each. Numbers make its run accept that.
    """
    from sim_action.app.matrix import FileOfScenarios
    from sim_action.core.discovery import file_name
    from sim_action.core.permissions import Permissions
    from sim_action.core.wording import escaped_line

    contents = suite.read(Permissions())
    if contents.unmatched:
        # A shard gets numbers and cannot report it.
        problems = [str(problem) for unmatched in contents.unmatched[:1] for problem in unmatched.unreadable]
        raise UsageError("\n".join((*map(str, contents.unmatched), *map(escaped_line, problems))))
    read = contents.files.items()
    numbers = {path: [each.number for each in scenarios if suite.numbered(each)] for path, scenarios in read}
    several = max(len(suite.selection.only), len(suite.selection.tags)) > 1
    return [
        FileOfScenarios(path, some, not several and file_name(path) not in suite.numbers)
        for path, some in numbers.items()
        if some
    ]
