"""A comparison for a pull request: a headline, a table of what has changed, worst first; it fits into a comment."""

from __future__ import annotations

from typing import Final

from sim_action.reports.comparison_rows import Look, Row, headline, rows
from sim_action.reports.escaping import markdown_text, shortened
from sim_action.reports.markdown import code, row, table
from sim_action.results.comparison import Comparison

MOST_CHARACTERS: Final = 60_000
"""GitHub takes 65,536 in a comment."""

_ICONS: Final[dict[Look, str]] = {"bad": "❌", "warning": "⚠️", "note": "📝", "good": "✅"}
_FRAME: Final = 2_000
_MOST_TOLD: Final = 300
_MOST_IN_NAME: Final = 100


def comparison_markdown(comparison: Comparison) -> str:
    """GitHub-flavoured Markdown, ending with a line end; everything found is escaped."""
    found = rows(comparison)
    written = _fitting(found)
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


def _fitting(found: list[Row]) -> list[str]:
    written, room = [], MOST_CHARACTERS - _FRAME
    for each in found:
        line = _row(each)
        room -= len(line) + 1
        if room < 0:
            break
        written.append(line)
    return written


def _row(each: Row) -> str:
    name = f"**{_text(each.outcome.name, _MOST_IN_NAME)}**"
    if each.outcome.file:
        name += f"<br><sub>{code(shortened(each.outcome.file, _MOST_IN_NAME))}</sub>"
    return row(_ICONS[each.look], each.what, name, _text(each.told, _MOST_TOLD))


def _text(text: str, most: int) -> str:
    return markdown_text(shortened(text, most))
