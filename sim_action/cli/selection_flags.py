"""The options of the command line that say which of the scenarios are meant."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

import click

from sim_action.core.errors import ExitCode

if TYPE_CHECKING:
    from sim_action.scenario.selection import Selection

Command = Callable[..., ExitCode]

_SELECTION: Final = (
    click.option("--only", multiple=True, metavar="PATTERN", help="Scenarios of such names; may be repeated."),
    click.option("--exclude", multiple=True, metavar="PATTERN", help="No scenarios of such names; may be repeated."),
    click.option("--tag", "tags", multiple=True, metavar="TAG", help="Scenarios with the tag; may be repeated."),
    click.option(
        "--exclude-tag", "exclude_tags", multiple=True, metavar="TAG", help="None with the tag; may be repeated."
    ),
)


def selection_flags(command: Command) -> Command:
    """Gives a command these options."""
    for option in reversed(_SELECTION):
        command = option(command)
    return command


def taken_selection(flags: dict[str, Any]) -> Selection:
    """What was typed, by the names that click gives it, which are taken out."""
    from sim_action.scenario.selection import Selection

    return Selection(**{name: tuple(flags.pop(name)) for name in ("only", "exclude", "tags", "exclude_tags")})
