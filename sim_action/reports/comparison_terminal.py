"""What a person reads after `sim-action compare`: a line for each thing that has changed, the worst last."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from typing import Final, TextIO

from rich.console import Console
from rich.text import Text

from sim_action.reports.comparison_rows import Look, Row, headline, rows
from sim_action.reports.console import console
from sim_action.reports.escaping import log_text, shortened
from sim_action.results.comparison import Comparison

_SYMBOLS: Final[dict[Look, str]] = {"bad": "✗", "warning": "!", "note": "·", "good": "✓"}
_ASCII_SYMBOLS: Final[dict[Look, str]] = {"bad": "x", "warning": "!", "note": "-", "good": "+"}
_STYLES: Final[dict[Look, str]] = {"bad": "bold red", "warning": "yellow", "note": "dim", "good": "green"}
_MOST_ROWS: Final = 200
_MOST_TOLD: Final = 300


def print_comparison(comparison: Comparison, environment: Mapping[str, str], stream: TextIO | None = None) -> None:
    """Prints to a stream, standard output unless another is given."""
    with console(stream or sys.stdout, environment) as shown:
        for line in _lines(comparison, shown):
            # Wrapped by the terminal, not by us: paths stay whole for those who click or copy them.
            shown.print(line, soft_wrap=True)


def _lines(comparison: Comparison, shown: Console) -> Iterator[Text]:
    found = rows(comparison)
    if len(found) > _MOST_ROWS:
        yield Text(f"{len(found) - _MOST_ROWS} more are left out here", "dim")
    listed = found[:_MOST_ROWS]
    width = max((len(row.what) for row in listed), default=0)
    encoding = shown.encoding
    symbols = _SYMBOLS if log_text("✗·✓", encoding) == "✗·✓" else _ASCII_SYMBOLS
    for row in reversed(listed):
        yield _line(row, symbols[row.look], width, encoding)
    worst: Look = "bad" if comparison.failures else "warning" if comparison.warnings else "good"
    yield Text(headline(comparison), _STYLES[worst])


def _line(row: Row, symbol: str, width: int, encoding: str) -> Text:
    place = f"  {row.outcome.location}" if row.outcome.location else ""
    parts = (
        (f"{symbol} {row.what.ljust(width)}  ", _STYLES[row.look]),
        (row.outcome.name, "bold"),
        (place, "dim"),
        (f"  {shortened(row.told, _MOST_TOLD)}" if row.told else "", ""),
    )
    return Text.assemble(*((log_text(text, encoding).replace("\n", " "), style) for text, style in parts))
