"""`sim-action validate`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import click

from sim_action.cli.options import ALLOW_OUTSIDE, PACKAGES, PATHS, discovered, named_packages, strict_option
from sim_action.core.errors import ExitCode, InternalError
from sim_action.core.permissions import Permissions, scripts_refused
from sim_action.core.wording import log_line
from sim_action.scenario.loading import load_all
from sim_action.scenario.source import Refused


@click.command()
@PATHS
@strict_option
@PACKAGES
@ALLOW_OUTSIDE
def validate(paths: Sequence[str], strict: bool, packages: Sequence[str], allow_outside: bool) -> ExitCode:
    """Check scenarios without running them, and report all problems.

    PATHS are scenario files, globs, or folders. A folder stands for every *.sim.yml and *.sim.yaml in it and below. The
    default is the current folder.

    Exit code: 0 all scenarios are valid; 1 a scenario has a warning, with --strict; 2 a scenario or the command line is
    invalid; 3 internal error of sim-action; 5 no scenario found.
    """
    suite = discovered(paths, outside=allow_outside)
    refused_here = scripts_refused("auto", os.environ, (Path.cwd(), *(path.parent for path in suite.files)))
    permissions = Permissions(allow_outside, imports_refused=refused_here, packages=named_packages(packages))
    checked = load_all(suite.scenarios(permissions), permissions)
    refused = [scenario for scenario in checked if isinstance(scenario, Refused)]
    valid = [scenario for scenario in checked if not isinstance(scenario, Refused)]
    # What several share may be wrong in each of them, and stands in one place.
    messages = [message for scenario in refused for message in _messages(scenario)]
    messages += [f"{loaded.file}: not checked: {remark}" for loaded in valid for remark in loaded.unchecked]
    warnings = [warning for loaded in valid for warning in loaded.warnings]
    messages += [f"{warning.location}: {'error' if strict else 'warning'}: {warning}" for warning in warnings]
    for line in (line for message in dict.fromkeys(messages) for line in message.split("\n")):
        click.echo(log_line(line))
    scenarios = len({(loaded.file, loaded.source.group or loaded.scenario.name) for loaded in valid})
    runs = f" ({len(valid)} runs with all variations)" if len(valid) > scenarios else ""
    click.echo(f"{scenarios} valid, {_count(refused)}{runs}", err=bool(refused))
    if not suite.files:
        return ExitCode.of_command(has_scenarios=False)
    codes = (scenario.error.exit_code for scenario in refused)
    unnamed = (ExitCode.INVALID for _ in suite.empty)
    return ExitCode.of_command((*codes, *unnamed), has_failed=strict and bool(warnings))


def _messages(refused: Refused) -> list[str]:
    details = refused.error.details if isinstance(refused.error, InternalError) else ""
    return [f"{problem}\n{details}".rstrip() for problem in refused.problems]


def _count(refused: Sequence[Refused]) -> str:
    """Return the counts of invalid scenarios, invalid variations and scenarios that sim-action failed to check."""
    faults = sum(isinstance(scenario.error, InternalError) for scenario in refused)
    alone = sum(scenario.group is not None for scenario in refused)
    variations = f", {alone} {'variation' if alone == 1 else 'variations'} invalid" if alone else ""
    unchecked = f", {faults} not checked to the end" if faults else ""
    return f"{len(refused) - faults - alone} invalid{variations}{unchecked}"
