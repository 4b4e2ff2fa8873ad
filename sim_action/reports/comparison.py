"""What there is to say of a comparison, worst first, before it is written for a terminal or as Markdown."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final, Literal, TextIO

from rich.console import Console
from rich.text import Text

from sim_action.reports.escaping import log_text, markdown_text, shortened
from sim_action.reports.formatting import measurements, quantity, speed_text
from sim_action.reports.github.markdown import code, row, table
from sim_action.reports.terminal import open_console
from sim_action.results.comparison import Change, Comparison, Shrunk, Turn
from sim_action.results.outcome import ExpectationOutcome, Outcome

Look = Literal["bad", "warning", "note", "good"]

_LOOKS: Final[dict[Turn, Look]] = {
    "newly fails": "bad",
    "flaky": "bad",
    "not run": "warning",
    "gone": "warning",
    "not repeated": "warning",
    "fails otherwise": "note",
    "still fails": "note",
    "mended": "good",
    "new": "good",
}
_ORDER: Final[tuple[Look, ...]] = ("bad", "warning", "note", "good")


@dataclass(frozen=True, slots=True)
class Row:
    """One thing that has changed of one scenario; texts are as they were found."""

    look: Look
    what: str
    outcome: Outcome
    told: str


def rows(comparison: Comparison) -> list[Row]:
    """The worst first, of equals in the order of the runs; what passes as it did has none."""
    found = [each for change in comparison.changes for each in _rows_of(change)]
    return sorted(found, key=lambda each: _ORDER.index(each.look))


def headline(comparison: Comparison) -> str:
    """Such as "1 newly fails, 2 warnings, 1 mended, 12 still pass"."""
    warnings = comparison.warnings
    named = (
        (comparison.count("newly fails"), "newly fails", "newly fail"),
        (comparison.count("flaky"), "flaky", "flaky"),
        (warnings, "warning", "warnings"),
        (comparison.count("fails otherwise"), "fails otherwise", "fail otherwise"),
        (comparison.count("still fails"), "still fails", "still fail"),
        (comparison.count("mended"), "mended", "mended"),
        (comparison.count("new"), "new", "new"),
        (comparison.count("still passes"), "still passes", "still pass"),
    )
    told = [f"{count} {one if count == 1 else several}" for count, one, several in named if count]
    return ", ".join(told) or "no scenario"


def _rows_of(change: Change) -> Iterator[Row]:
    if look := _LOOKS.get(change.turn):
        yield Row(look, change.turn, change.outcome, _detail(change))
    for missed in change.missed:
        yield Row("warning", "holds no longer", change.outcome, f"{missed.name}: {missed.verdict.message}")
    for shrunk in change.shrunk:
        yield Row("warning", "margin shrinks", change.outcome, _shrunk_text(shrunk))
    elsewhere = "" if change.processors is None else " (on another machine: {}, now {})".format(*change.processors)
    if slower := change.slower:
        told = f"{speed_text(slower.old)}, now {speed_text(slower.new)}{elsewhere}"
        yield Row("note" if elsewhere else "warning", "slower", change.outcome, told)
    # Of a verdict that is another one, it is no news.
    if change.behaves_otherwise and change.turn in ("still passes", "still fails"):
        told = f"another digest with the same seed, on the same engine{elsewhere}"
        yield Row("note", "moves otherwise", change.outcome, told)


def _detail(change: Change) -> str:
    """Why it fails now, or why it did; of the rest, what it was."""
    if change.turn == "mended":
        return f"failed before: {_reason(change.old)}"
    if change.turn == "not repeated":
        return "was flaky, and has run once"
    if change.turn in ("gone", "not run"):
        return "" if change.old is None else f"was: {change.old.status}"
    reason = _reason(change.outcome)
    if change.turn == "fails otherwise" and change.old:
        return f"was: {change.old.status}; {reason}"
    return f"{reason}{_before(change)}" if change.turn == "newly fails" else reason


def _reason(outcome: Outcome | None) -> str:
    """The first that there is; empty if all is well."""
    if outcome is None:
        return ""
    told = [f"{failure.title}: {failure.message}" for failure in outcome.failures]
    told += [f"{expected.name}: {expected.verdict.message}" for expected in outcome.causes_first if expected.failed]
    return told[0] if told else ""


def _before(change: Change) -> str:
    """What was measured when it held; nothing of what has no more than two values, such as whether it touched."""
    failed = next((expected for expected in change.outcome.causes_first if expected.failed), None)
    held = _same(change.old, failed)
    told = measurements(held.verdict) if held and held.verdict.margin else ""
    return f"; before: {told}" if told else ""


def _same(outcome: Outcome | None, failed: ExpectationOutcome | None) -> ExpectationOutcome | None:
    if outcome is None or failed is None:
        return None
    return next((each for each in outcome.expectations if each.name == failed.name), None)


def _shrunk_text(shrunk: Shrunk) -> str:
    """Such as "clearance: 0.4 m (27 % of its limit), now 0.1 m (7 %)"."""
    old, new = (quantity(value, shrunk.unit) for value in (shrunk.old, shrunk.new))
    of_old = "" if shrunk.old_share is None else f" ({shrunk.old_share:.0%} of its limit)"
    of_new = "" if shrunk.new_share is None else f" ({shrunk.new_share:.0%})"
    return f"{shrunk.expectation}: margin {old}{of_old}, now {new}{of_new}"


_LOOK_SYMBOLS: Final[dict[Look, str]] = {"bad": "✗", "warning": "!", "note": "·", "good": "✓"}
_ASCII_LOOK_SYMBOLS: Final[dict[Look, str]] = {"bad": "x", "warning": "!", "note": "-", "good": "+"}
_LOOK_STYLES: Final[dict[Look, str]] = {"bad": "bold red", "warning": "yellow", "note": "dim", "good": "green"}
_MAX_TERMINAL_ROWS: Final = 200
_MAX_TERMINAL_TEXT: Final = 300


def print_comparison(comparison: Comparison, environment: Mapping[str, str], stream: TextIO | None = None) -> None:
    """Prints to a stream, standard output unless another is given."""
    with open_console(stream or sys.stdout, environment) as shown:
        for line in _terminal_lines(comparison, shown):
            # Wrapped by the terminal, not by us: paths stay whole for those who click or copy them.
            shown.print(line, soft_wrap=True)


def _terminal_lines(comparison: Comparison, shown: Console) -> Iterator[Text]:
    found = rows(comparison)
    if len(found) > _MAX_TERMINAL_ROWS:
        yield Text(f"{len(found) - _MAX_TERMINAL_ROWS} more are left out here", "dim")
    listed = found[:_MAX_TERMINAL_ROWS]
    width = max((len(each.what) for each in listed), default=0)
    encoding = shown.encoding
    symbols = _LOOK_SYMBOLS if log_text("✗·✓", encoding) == "✗·✓" else _ASCII_LOOK_SYMBOLS
    for each in reversed(listed):
        yield _terminal_line(each, symbols[each.look], width, encoding)
    worst: Look = "bad" if comparison.failures else "warning" if comparison.warnings else "good"
    yield Text(headline(comparison), _LOOK_STYLES[worst])


def _terminal_line(each: Row, symbol: str, width: int, encoding: str) -> Text:
    place = f"  {each.outcome.location}" if each.outcome.location else ""
    parts = (
        (f"{symbol} {each.what.ljust(width)}  ", _LOOK_STYLES[each.look]),
        (each.outcome.name, "bold"),
        (place, "dim"),
        (f"  {shortened(each.told, _MAX_TERMINAL_TEXT)}" if each.told else "", ""),
    )
    return Text.assemble(*((log_text(text, encoding).replace("\n", " "), style) for text, style in parts))


MAX_CHARACTERS: Final = 60_000
"""GitHub takes 65,536 in a comment."""

_LOOK_ICONS: Final[dict[Look, str]] = {"bad": "❌", "warning": "⚠️", "note": "📝", "good": "✅"}
_FRAME_CHARACTERS: Final = 2_000
_MAX_MARKDOWN_TEXT: Final = 300
_MAX_NAME: Final = 100


def comparison_markdown(comparison: Comparison) -> str:
    """GitHub-flavoured Markdown, ending with a line end; everything found is escaped."""
    found = rows(comparison)
    written = _fitting_rows(found)
    parts = [
        f"## {_title(comparison)}",
        f"**{headline(comparison)}**, compared with the run before",
        table(("", "Change", "Scenario", "What happened"), written) if written else "",
        f"_{len(found) - len(written)} more changes are left out here._" if len(found) > len(written) else "",
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _title(comparison: Comparison) -> str:
    flaky, failing = comparison.count("flaky"), comparison.count("newly fails")
    if failing:
        more = f", {flaky} flaky" if flaky else ""
        return f"❌ {failing} {'scenario newly fails' if failing == 1 else 'scenarios newly fail'}{more}"
    if flaky:
        return f"🎲 {flaky} {'scenario is' if flaky == 1 else 'scenarios are'} flaky"
    if count := comparison.warnings:
        return f"⚠️ Nothing newly fails, {count} {'warning' if count == 1 else 'warnings'}"
    return "✅ Nothing newly fails"


def _fitting_rows(found: list[Row]) -> list[str]:
    written, room = [], MAX_CHARACTERS - _FRAME_CHARACTERS
    for each in found:
        line = _markdown_row(each)
        room -= len(line) + 1
        if room < 0:
            break
        written.append(line)
    return written


def _markdown_row(each: Row) -> str:
    name = f"**{_markdown_cell(each.outcome.name, _MAX_NAME)}**"
    if each.outcome.file:
        name += f"<br><sub>{code(shortened(each.outcome.file, _MAX_NAME))}</sub>"
    return row(_LOOK_ICONS[each.look], each.what, name, _markdown_cell(each.told, _MAX_MARKDOWN_TEXT))


def _markdown_cell(text: str, most: int) -> str:
    return markdown_text(shortened(text, most))
