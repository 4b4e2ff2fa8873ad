"""HTML for notebooks: the lines of the terminal report, the frame of `report.html`, and the player of one run.

A notebook has a light or a dark theme, and its style sheet is unknown here. So each element has a style of its own,
and each colour has a contrast of about 4 or more to white and to black.
"""

from __future__ import annotations

import platform
from collections.abc import Mapping
from html import escape
from types import MappingProxyType
from typing import Final

from sim_action.core.provenance import platform_name
from sim_action.core.records import replace
from sim_action.core.version import __version__
from sim_action.reports import ReportOptions
from sim_action.reports.display import Console
from sim_action.reports.html.document import Page
from sim_action.reports.html.report import page
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results

_STYLES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "": "",
        "bold": "font-weight: 600",
        "dim": "opacity: 0.7",
        "green": "color: #23873e; font-weight: 600",
        "yellow": "color: #977400",
        "cyan": "color: #188395",
        "bold red": "color: #e03c36; font-weight: 600",
        "bold yellow": "color: #977400; font-weight: 600",
        "bold magenta": "color: #b252cf; font-weight: 600",
    }
)
"""Style of `Console` -> its properties in CSS."""

_LINES: Final = (
    'font-family: ui-monospace, "SF Mono", "Cascadia Mono", "DejaVu Sans Mono", monospace; font-size: 0.9em; '
    "line-height: 1.5; white-space: pre-wrap; word-break: normal; overflow-wrap: anywhere; margin: 0.3em 0"
)
_HANGING_CH: Final = 2  # the further lines of a long line start so many characters after its first one

# High enough for a failed expectation, the replay and its controls on a desktop; no higher than a phone.
_REPORT_PX: Final = 920
_PLAYER_PX: Final = 460
_FRAME: Final = (
    "box-sizing: border-box; width: 100%; height: {}px; max-height: 95vh; border: 1px solid #8886; border-radius: 4px"
)


class HtmlConsole(Console):
    """Lines as HTML. `encoding`: the encoding of the text."""

    def __init__(self) -> None:
        self.encoding = "utf-8"
        self._lines: list[str] = []

    def print(self, *parts: tuple[str, str]) -> None:
        """Add a line of parts with their styles; the first part has the spaces before the text."""
        (margin, _), *rest = parts
        indent = len(margin) + _HANGING_CH
        text = "".join(_styled(self._shown(words), style) for words, style in rest) or "<br>"
        self._lines.append(f'<div style="padding-left: {indent}ch; text-indent: -{_HANGING_CH}ch">{text}</div>')

    def html(self) -> str:
        """Return all lines, without empty ones at the end."""
        lines = list(self._lines)
        while lines and lines[-1].endswith("<br></div>"):
            lines.pop()
        return f'<div style="{escape(_LINES)}">{"".join(lines)}</div>'


def report_frame(page: str) -> str:
    """Return a frame with the text of `report.html`, whose policy holds in it."""
    return _frame("sim-action report", _REPORT_PX, page)


def player_frame(page: str) -> str:
    """Return a frame with the text of a page that shows only a player."""
    return _frame("sim-action replay", _PLAYER_PX, page)


def _frame(title: str, height: int, page: str) -> str:
    return f'<iframe title="{title}" style="{_FRAME.format(height)}" srcdoc="{escape(page)}"></iframe>'


def _styled(text: str, style: str) -> str:
    css = _STYLES[style]
    return f'<span style="{css}">{escape(text)}</span>' if css else escape(text)


def outcome_page(outcome: Outcome, options: ReportOptions) -> Page | None:
    """Return the page of a run; None if it has no replay."""
    results = Results(
        sim_action=__version__,
        python=platform.python_version(),
        platform=platform_name(),
        wall_time=outcome.wall_time,
        # Without its gate and its other variations, a run counts by itself.
        outcomes=(outcome.model_copy(update={"gate": None, "group": None}),),
    )
    made = page(results, options)
    return replace(made, is_embedded=True) if made.has_replays else None
