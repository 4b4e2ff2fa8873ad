"""The display of statuses, the same in every report, and coloured lines on a terminal.

The table of all statuses has symbol, words, colour, JUnit element and annotation level.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from types import MappingProxyType
from typing import Final, Literal, TextIO

from sim_action.core.records import dataclass
from sim_action.reports.escaping import log_text
from sim_action.results.outcome import DisplayStatus

Level = Literal["error", "warning"]  # the level of an annotation


@dataclass(frozen=True, slots=True)
class StatusDisplay:
    """The display of one status."""

    word: str  # the status inside a sentence
    headline: str  # the status above a scenario in `report.html`
    meaning: str  # one line for the documents
    symbol: str  # the character on the terminal and in `report.html`
    ascii_symbol: str  # the character on a terminal without Unicode
    icon: str  # the emoji in the job summary
    style: str  # the colour on the terminal, see `Console`. The style sheet of the page has a class of each status.
    # the element inside a testcase; None: no element, so the testcase passes
    junit: Literal["error", "failure", "skipped"] | None = None
    level: Level | None = None  # the level of the annotation; None: no annotation

    def counted(self, count: int) -> str:
        """Return a count with the word, such as "2 errors" or "2 failed"."""
        return f"{count} {self.word}{'s' if count > 1 and self.word in ('error', 'warning') else ''}"


STATUS_DISPLAYS: Final[Mapping[DisplayStatus, StatusDisplay]] = MappingProxyType(
    {
        "error": StatusDisplay(
            *("error", "No verdict"),
            "there is no verdict: the scenario is invalid, crashed, or reached a limit of the process",
            *("‼", "E", "💥", "bold red"),
            junit="error",
            level="error",
        ),
        "failed": StatusDisplay(
            *("failed", "Failed"),
            "an expectation was judged and did not hold",
            *("✗", "x", "❌", "bold red"),
            junit="failure",
            level="error",
        ),
        "flaky": StatusDisplay(
            *("flaky", "Flaky: its runs differ"),
            "repeated runs are not equal bit for bit",
            *("≠", "?", "🎲", "bold red"),
            junit="error",
            level="error",
        ),
        "inconclusive": StatusDisplay(
            *("inconclusive", "Inconclusive: neither shown nor refuted"),
            "runs of a gate, or repetitions, neither show nor refute the claim",
            *("≈", "~", "⚖️", "bold yellow"),
            junit="failure",
            level="error",
        ),
        "not_exercised": StatusDisplay(
            *("not exercised", "Not exercised: something was never checked"),
            "nothing failed, but an expectation was never judged: no moment of the run could check it",
            *("∅", "0", "⭕", "bold magenta"),
            junit="error",
            level="error",
        ),
        "warned": StatusDisplay(
            *("warning", "Passed, with a warning"),
            "passed, but an expectation did not hold or was never judged and the scenario accepts that, or the audit "
            "of claims found a part that checked nothing",
            *("!", "!", "⚠️", "yellow"),
            level="warning",
        ),
        "skipped": StatusDisplay(
            *("not run", "Not run"),
            "not run, because another scenario did not pass and `--fail-fast` is set, or because its gate was decided",
            *("·", "-", "⏭️", "dim"),
            junit="skipped",
        ),
        "passed": StatusDisplay(
            *("passed", "Passed"),
            "every expectation was judged at one moment at least, and held",
            *("✓", "+", "✅", "green"),
        ),
    }
)
"""The display of each status."""

INFORMATION: Final = StatusDisplay(
    *("information", "Measured, without a limit"),
    "a value that was measured without a limit, such as the distance between two engines: nothing was judged",
    *("ℹ", "i", "ℹ️", "cyan"),  # noqa: RUF001 - the sign of information
)
"""The display of a measurement, which is neither a pass nor a failure."""

RowStatus = DisplayStatus | Literal["information"]  # the status of a row in a table


def display_of(status: RowStatus) -> StatusDisplay:
    """Return the display of the status of a row."""
    return INFORMATION if status == "information" else STATUS_DISPLAYS[status]


Line = Sequence[tuple[str, str]]  # the parts of a line and their styles

_CODES: Final = MappingProxyType(
    {
        "": "",
        "bold": "1",
        "dim": "2",
        "green": "32",
        "yellow": "33",
        "cyan": "36",
        "bold red": "1;31",
        "bold yellow": "1;33",
        "bold magenta": "1;35",
    }
)
"""Style -> its parameters of the control sequence SGR (ECMA-48)."""

_PLAIN_TERMINALS: Final = ("dumb", "unknown")


_ALL_SYMBOLS: Final = "".join(display.symbol for display in (*STATUS_DISPLAYS.values(), INFORMATION))
"""A console that cannot show one of these characters gets ASCII characters for all statuses."""


class Console:
    """A stream in an `encoding` for lines with styles; no text acts as markup or as a control sequence."""

    def __init__(self, stream: TextIO, *, colourful: bool) -> None:
        self._stream, self._colourful = stream, colourful
        self.encoding = stream.encoding or "utf-8"

    def print(self, *parts: tuple[str, str]) -> None:
        """Print parts with their styles on one line. The terminal wraps it, so that paths can be copied as a whole."""
        self._stream.write("".join(self._styled(*part) for part in parts) + "\n")

    def can_show(self, symbols: str) -> bool:
        """Return True if the encoding has all of these characters."""
        return log_text(symbols, self.encoding) == symbols

    def mark(self, display: StatusDisplay) -> tuple[str, str]:
        """Return the symbol of a status, with a space behind it, and its style."""
        return f"{display.symbol if self.can_show(_ALL_SYMBOLS) else display.ascii_symbol} ", display.style

    def _styled(self, text: str, style: str) -> str:
        text, code = self._shown(text), _CODES[style]
        return f"\x1b[{code}m{text}\x1b[0m" if code and text and self._colourful else text

    def _shown(self, text: str) -> str:
        return log_text(text, self.encoding).replace("\n", " ")


def shows_colours(stream: TextIO, environment: Mapping[str, str]) -> bool:
    """Return True for terminals and for the log of GitHub. The user decides by `NO_COLOR` and `FORCE_COLOR`."""
    if environment.get("NO_COLOR"):
        return False
    if environment.get("GITHUB_ACTIONS") == "true" or environment.get("FORCE_COLOR"):
        return True
    return is_full_terminal(stream, environment)


def is_full_terminal(stream: TextIO, environment: Mapping[str, str]) -> bool:
    """Return True for a terminal that knows control sequences."""
    return stream.isatty() and environment.get("TERM", "").lower() not in _PLAIN_TERMINALS


@contextmanager
def open_console(stream: TextIO, environment: Mapping[str, str]) -> Iterator[Console]:
    """Open a console on a stream; on GitHub, workflow commands in the printed text have no effect."""
    on_github = environment.get("GITHUB_ACTIONS") == "true"
    with _no_workflow_commands(stream) if on_github else _as_it_is(stream):
        yield Console(stream, colourful=shows_colours(stream, environment))


@contextmanager
def _no_workflow_commands(stream: TextIO) -> Iterator[None]:
    """Disable workflow commands while text is printed; the token that enables them again is random."""
    token = os.urandom(16).hex()
    stream.write(f"::stop-commands::{token}\n")
    try:
        yield
    finally:
        stream.write(f"::{token}::\n")
        stream.flush()


@contextmanager
def _as_it_is(stream: TextIO) -> Iterator[None]:
    yield
    stream.flush()
