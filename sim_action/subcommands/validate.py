"""`sim-action validate`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from sim_action.errors import ExitCode
from sim_action.subcommands.paths import ALLOW_OUTSIDE, PATHS, discovered

if TYPE_CHECKING:
    from collections.abc import Sequence


@click.command()
@PATHS
@ALLOW_OUTSIDE
def validate(paths: Sequence[str], allow_outside: bool) -> ExitCode:
    """Find everything that is wrong with scenarios without running them."""
    from sim_action.loading import load_all
    from sim_action.messages import log_line
    from sim_action.permissions import Permissions

    files, empty = discovered(paths)
    valid, invalid = load_all(files, Permissions(allow_outside))
    for error in invalid.values():
        for problem in error.problems:
            click.echo(log_line(str(problem)))
    for loaded in valid.values():
        for remark in loaded.unchecked:
            click.echo(log_line(f"{loaded.file}: not checked: {remark}"))
    click.echo(f"{len(valid)} valid, {len(invalid)} invalid", err=bool(invalid))
    if not files:
        return ExitCode.NO_SCENARIO
    return ExitCode.INVALID if invalid or empty else ExitCode.PASSED
