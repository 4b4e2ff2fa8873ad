"""The table of all statuses: symbol, words, colour, JUnit element and annotation level, the same in every report."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, Literal

from sim_action.core.records import dataclass
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


STATUS_DISPLAYS: Final[Mapping[DisplayStatus, StatusDisplay]] = MappingProxyType(
    {
        "error": StatusDisplay(
            word="error",
            headline="No verdict",
            meaning="there is no verdict: the scenario is invalid, crashed, or reached a limit of the process",
            symbol="‼",
            ascii_symbol="E",
            icon="💥",
            style="bold red",
            junit="error",
            level="error",
        ),
        "failed": StatusDisplay(
            word="failed",
            headline="Failed",
            meaning="an expectation was judged and did not hold",
            symbol="✗",
            ascii_symbol="x",
            icon="❌",
            style="bold red",
            junit="failure",
            level="error",
        ),
        "flaky": StatusDisplay(
            word="flaky",
            headline="Flaky: its runs differ",
            meaning="repeated runs are not equal bit for bit",
            symbol="≠",
            ascii_symbol="?",
            icon="🎲",
            style="bold red",
            junit="error",
            level="error",
        ),
        "inconclusive": StatusDisplay(
            word="inconclusive",
            headline="Inconclusive: too few runs to tell",
            meaning="the runs of a gate neither show nor refute what it claims",
            symbol="≈",
            ascii_symbol="~",
            icon="⚖️",
            style="bold yellow",
            junit="failure",
            level="error",
        ),
        "not_exercised": StatusDisplay(
            word="not exercised",
            headline="Not exercised: something was never checked",
            meaning="nothing failed, but an expectation was never judged: no moment of the run could check it",
            symbol="∅",
            ascii_symbol="0",
            icon="⭕",
            style="bold magenta",
            junit="error",
            level="error",
        ),
        "warned": StatusDisplay(
            word="warning",
            headline="Passed, with a warning",
            meaning="passed, but an expectation did not hold or was never judged and the scenario accepts that, or the "
            "audit of claims found a part that checked nothing",
            symbol="!",
            ascii_symbol="!",
            icon="⚠️",
            style="yellow",
            level="warning",
        ),
        "skipped": StatusDisplay(
            word="not run",
            headline="Not run",
            meaning="not run, because another scenario did not pass and `--fail-fast` is set, or because its gate was "
            "decided",
            symbol="·",
            ascii_symbol="-",
            icon="⏭️",
            style="dim",
            junit="skipped",
        ),
        "passed": StatusDisplay(
            word="passed",
            headline="Passed",
            meaning="every expectation was judged at one moment at least, and held",
            symbol="✓",
            ascii_symbol="+",
            icon="✅",
            style="green",
        ),
    }
)
"""The display of each status."""

INFORMATION: Final = StatusDisplay(
    word="information",
    headline="Measured, without a limit",
    meaning="a value that was measured without a limit, such as the distance between two engines: nothing was judged",
    symbol="ℹ",  # noqa: RUF001 - the sign of information
    ascii_symbol="i",
    icon="ℹ️",  # noqa: RUF001 - see above
    style="cyan",
)
"""The display of a measurement, which is neither a pass nor a failure."""

RowStatus = DisplayStatus | Literal["information"]  # the status of a row in a table


def display_of(status: RowStatus) -> StatusDisplay:
    """Return the display of the status of a row."""
    return INFORMATION if status == "information" else STATUS_DISPLAYS[status]
