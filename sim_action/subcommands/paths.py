"""What several subcommands take and say: the paths of scenarios, and remarks on standard error."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Final

import click

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

PATHS: Final = click.argument("paths", nargs=-1, metavar="[PATHS]...")
ALLOW_OUTSIDE: Final = click.option(
    "--allow-outside", is_flag=True, help="Let scenarios name files outside of their workspace."
)


def discovered(paths: Sequence[str]) -> tuple[list[Path], list[str]]:
    """The scenario files, and what was named but holds none; if nothing was, as pyproject.toml says, or all below."""
    from sim_action.discovery import compared_name, discover, unique

    found = discover(paths or click.get_current_context().lookup_default("paths") or ["."])
    # However it is spelled, it is one outcome.
    empty: dict[str, str] = {}
    for pattern in (pattern for pattern, matches in found.items() if not matches):
        empty.setdefault(compared_name(pattern), pattern)
    files = unique(found)
    for pattern in empty.values():
        # Beside others, it is in the reports.
        (note if files else complain)(f"no scenario in or at '{pattern}'")
    return files, list(empty.values())


def note(message: str) -> None:
    """Says something that is no error."""
    from sim_action.messages import log_line

    click.echo(log_line(f"sim-action: {message}"), err=True)


def complain(message: str) -> None:
    """Tells an error; on GitHub, as an annotation."""
    from sim_action.reports.annotations import complaint

    click.echo(complaint(message, os.environ), err=True)
