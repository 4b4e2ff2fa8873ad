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
    from sim_action.scenario_files import read_file
    from sim_action.source import Refused

    files, empty = discovered(paths)
    permissions = Permissions(allow_outside)
    found = load_all((source for path in files for source in read_file(path, permissions)), permissions)
    invalid = [scenario for scenario in found if isinstance(scenario, Refused)]
    valid = [scenario for scenario in found if not isinstance(scenario, Refused)]
    # What several share may be wrong in each of them, and stands in one place.
    lines = [str(problem) for refused in invalid for problem in refused.error.problems]
    lines += [f"{loaded.file}: not checked: {remark}" for loaded in valid for remark in loaded.unchecked]
    for line in dict.fromkeys(lines):
        click.echo(log_line(line))
    scenarios = len({(loaded.file, loaded.source.group or loaded.scenario.name) for loaded in valid})
    runs = f" ({len(valid)} runs with all variations)" if len(valid) > scenarios else ""
    click.echo(f"{scenarios} valid, {len(invalid)} invalid{runs}", err=bool(invalid))
    if not files:
        return ExitCode.NO_SCENARIO
    return ExitCode.INVALID if invalid or empty else ExitCode.PASSED
