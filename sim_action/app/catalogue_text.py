"""What a scenario can name, for people at a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import click

from sim_action.scenario.catalogue import Entry


def listing(entries: Iterable[Entry]) -> str:
    """Each entry with its fields below it."""
    return "\n".join(line for entry in entries for line in _lines(entry))


def _lines(entry: Entry) -> Iterator[str]:
    yield click.style(entry.name, bold=True)
    yield f"  {entry.summary}"
    for field in entry.fields:
        default = f"  [{field.default}]" if field.default else ""
        description = f"  {field.description}" if field.description else ""
        yield f"    {field.name}: {field.takes}{default}{description}"
