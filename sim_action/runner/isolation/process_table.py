"""The processes of this machine, as Linux lists them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple


class Process(NamedTuple):
    """One process: its number, that of its parent, and that of its session."""

    number: int
    parent: int
    session: int


def processes() -> Iterator[Process]:
    """Those that can be seen, also those that have ended and are not reaped yet."""
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                stat = (folder / "stat").read_bytes()
            except OSError:
                continue
            # The name of the program comes before, in brackets, and may hold brackets itself.
            _state, parent, _group, session, *_ = stat[stat.rindex(b")") + 2 :].split()
            yield Process(int(folder.name), int(parent), int(session))
