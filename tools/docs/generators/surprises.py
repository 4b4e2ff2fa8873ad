"""The list of docs/engines/surprises.md: surprises of engines and formats."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

TABLE: Final = Path(__file__).parents[1] / "surprises.toml"

Does = Literal["right", "note", "refused", "unused"]


@dataclass(frozen=True)
class Surprise:
    """A row of the table.

    Attributes:
        library: with its version.
        script: the name of a finding; empty if there is none.
        source: where the behaviour is stated; empty if there is a script.
        does, how: what sim-action does about it.
        test: the file and the name of its test; empty if sim-action does not use this.
    """

    library: str
    surprise: str
    does: Does
    how: str
    script: str = ""
    source: str = ""
    test: str = ""


def surprises() -> Sequence[Surprise]:
    """Return the rows of the table, in the order of the file."""
    rows = tomllib.loads(TABLE.read_text(encoding="utf-8"))["surprise"]
    return [Surprise(library=row.pop("with"), **row) for row in rows]


HEADS: Final = {
    "note": "sim-action decides, and a note in the result says how",
    "refused": "The scenario is refused, or the run is an error, with the reason",
}


def rows() -> str:
    """Return the lists of surprises, by what sim-action does; those it does right are in the scripts of findings/."""
    shown_rows = [row for row in surprises() if row.does != "right"]
    by_effect = {does: [row for row in shown_rows if row.does == does] for does in HEADS}
    return "\n".join(
        f"## {HEADS[does]}\n\n{''.join(map(_entry, by_effect[does]))}" for does in HEADS if by_effect[does]
    )


def _entry(row: Surprise) -> str:
    surprise = f"[{row.surprise.rstrip('.')}](/findings/{row.script}.sh)." if row.script else row.surprise
    how = f" {row.how}" if row.does in {"note", "refused"} else ""
    return f"- {row.library}: {surprise}{how}\n"
