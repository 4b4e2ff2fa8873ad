"""The tables of docs/engines/surprises.md: surprises of engines and formats, and how readers understand URDF."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from tests.readers.classes import CLASSES
from tools.docs.generators.markdown import table

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


def rows() -> str:
    """Return the table of surprises."""
    return table(("with", "surprise", "sim-action", "tested by"), map(_cells, surprises()))


def _cells(row: Surprise) -> tuple[str, ...]:
    source = f"[script](/findings/{row.script}.sh)" if row.script else row.source
    file, _, name = row.test.partition("::")
    test = f"[`{name or Path(file).name}`](/{file})" if row.test else ""
    return (row.library, f"{row.surprise} ({source})", f"**{row.does}**: {row.how}", test)


def readers() -> str:
    """Return the table of differences between readers of URDF."""
    return table(
        ("readers", "differ in", "what", "who", "specification"),
        ((", ".join(row.readers), ", ".join(row.quantities), row.text, row.whose, row.clause) for row in CLASSES),
    )
