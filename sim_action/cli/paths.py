"""What several subcommands take and say: the paths of scenarios, and remarks on standard error."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Final

import click

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from sim_action.scenario.suite import Suite

PATHS: Final = click.argument("paths", nargs=-1, metavar="[PATHS]...")
ALLOW_OUTSIDE: Final = click.option(
    "--allow-outside", is_flag=True, help="Let scenarios name files outside of their workspace."
)


def discovered(paths: Sequence[str], flags: dict[str, Any] | None = None) -> Suite:
    """What is named; if nothing is, as pyproject.toml says, or all below. `flags`: as `taken_selection` has them."""
    from sim_action.cli.selection_flags import taken_selection
    from sim_action.core.discovery import compared_name, discover, unique
    from sim_action.scenario.numbering import split
    from sim_action.scenario.selection import Selection
    from sim_action.scenario.suite import Suite

    named = [split(path) for path in named_paths(paths)]
    found = discover(file for file, _ in named)
    # However it is spelled, it is one outcome.
    empty: dict[str, str] = {}
    for pattern in (pattern for pattern, matches in found.items() if not matches):
        empty.setdefault(compared_name(pattern), pattern)
    files = unique(found)
    numbers = _numbers(files, ((found[file], some) for file, some in named))
    selection = Selection() if flags is None else taken_selection(flags)
    for pattern in empty.values():
        # Beside others, it is in the reports.
        (note if files else complain)(f"no scenario in or at '{pattern}'")
    return Suite(files, tuple(empty.values()), numbers, selection)


def named_paths(paths: Sequence[str]) -> Sequence[str]:
    """What was typed, or else what stands in pyproject.toml, or else the current folder."""
    return paths or click.get_current_context().lookup_default("paths") or ["."]


def _numbers(
    files: Sequence[Path], named: Iterable[tuple[Sequence[Path], frozenset[int] | None]]
) -> dict[str, frozenset[int]]:
    """Of files that are named with numbers alone, all of these."""
    from sim_action.core.discovery import compared_name, file_name

    some: dict[str, frozenset[int]] = {}
    whole = set[str]()
    for path, numbers in ((path, numbers) for paths, numbers in named for path in paths):
        name = compared_name(str(path))
        if numbers is None:
            whole.add(name)
        else:
            some[name] = some.get(name, frozenset()) | numbers
    by_name = {compared_name(str(path)): file_name(path) for path in files} if some else {}
    return {by_name[name]: numbers for name, numbers in some.items() if name not in whole}


def note(message: str) -> None:
    """Says something that is no error."""
    from sim_action.core.messages import log_line

    click.echo(log_line(f"sim-action: {message}"), err=True)


def complain(message: str) -> None:
    """Tells an error; on GitHub, as an annotation."""
    from sim_action.reports.annotations import complaint

    click.echo(complaint(message, os.environ), err=True)
