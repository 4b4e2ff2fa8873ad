"""Tables of reports: rows with a status, a place, links and notes. No text in them is escaped.

One table has three writers: `Table.lines` for a terminal, `markdown_table` for GitHub and `html_table` for the page.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Final, TypeAlias

from sim_action.core import units
from sim_action.core.errors import Location
from sim_action.core.records import dataclass, field
from sim_action.core.wording import shortened
from sim_action.reports import ReportOptions
from sim_action.reports.display import Console, Line, RowStatus, StatusDisplay, display_of
from sim_action.reports.formatting import confidence_text, judged_text, moment, spread_texts
from sim_action.reports.links import replay_link
from sim_action.results.outcome import ExpectationOutcome, Outcome
from sim_action.scenario.variations.gate import GATE
from sim_action.state.verdict import Verdict

_MAX_TEXT: Final = 300  # the largest number of characters of a message on the line of its row
NUMBERS: Final = (" Measured", " Limit", " Margin", " At")  # the columns of the numbers of a verdict


@dataclass(frozen=True, slots=True)
class Bar:
    """A number with a bar in the page; other reports have its text."""

    text: str
    share: float  # the length of the bar, at most 1; NaN: it has none
    is_margin: bool = False  # True if the bar begins in the middle, for a positive share to the right


# A number is a sim time in s, which the page links to the replay.
Value: TypeAlias = str | float | Bar


@dataclass(frozen=True, slots=True)
class Row:
    """A row of a table."""

    status: RowStatus  # the status, whose symbol begins the row
    name: str  # the subject, such as an expectation
    message: str = ""  # the finding
    values: tuple[Value, ...] = ()  # the values of the further columns
    kind: str = ""  # the kind of the row, such as "newly fails"
    location: Location | None = None  # the place in the scenario file
    stands_out: bool = False  # True if every report shows the place and the values, not only the page
    interval: str = ""  # the widest interval of the margin that repetitions leave open; the page has it in the notes
    notes: tuple[str, ...] = ()  # remarks of minor importance; Markdown has no room for them
    replay: str = ""  # the link to the moment in the replay
    link: str = ""  # the element id of the article in the page
    is_neutral: bool = False  # True if the symbol has no colour, because the row does not count by itself
    below: Table | None = None  # the rows that the page has below this one, such as the variations of a scenario
    # name -> text by which the script of the page sorts and filters the rows
    data: Mapping[str, str | None] = field(default_factory=dict)

    @property
    def display(self) -> StatusDisplay:
        """The display of the status."""
        return display_of(self.status)


@dataclass(frozen=True, slots=True)
class Table:
    """Rows with the titles of their columns."""

    name: str  # the title of the names
    rows: tuple[Row, ...]  # the rows that are shown at once
    columns: tuple[str, ...] = ()  # the titles of the values; one that begins with a space is right-aligned
    message: str = ""  # the title of the messages; empty: a message stands below its name, and the page omits it
    kind: str = ""  # the title of the kinds; empty: no row has one
    rest: tuple[Row, ...] = ()  # the rows in a fold
    rest_title: str = ""  # the title of the fold
    orders: Mapping[str, str] = field(default_factory=dict)  # title -> name of the order of the rows by this column

    @property
    def titles(self) -> tuple[str, ...]:
        """The titles of all columns after the symbols."""
        return (*filter(None, (self.kind, self.name, self.message)), *self.columns)

    def values_of(self, row: Row) -> tuple[Value, ...]:
        """Return a value for each column; empty if the row lacks it."""
        return (*row.values, *("" for _ in self.columns))[: len(self.columns)]

    def lines(self, console: Console, indent: str = "", *, verbose: bool = False) -> Iterator[Line]:
        """Yield the lines for a terminal, with place and values below rows that are not short; `verbose`: of all."""
        width = max((len(row.kind) for row in self.rows), default=0)
        for row in (*self.rows, *self.rest):
            if self.kind:
                parts = (row.location, shortened(row.message, _MAX_TEXT))
                place, message = (f"  {part}" if part else "" for part in parts)
                start = [console.mark(row.display), (f"{row.kind.ljust(width)}  ", row.display.style)]
                yield [*start, (row.name, "bold"), (place, "dim"), (message, "")]
                continue
            message = f": {row.message}" if row.message else ""
            yield [(indent, ""), console.mark(row.display), (row.name, ""), (message, "")]
            pairs = zip(self.columns, row.values, strict=False)
            values = ", ".join(f"{title.strip().lower()} {value_text(value)}" for title, value in pairs if value != "")
            shown = [(values, "dim")] if verbose or row.stands_out else []
            shown += [(note, "dim") for note in (row.notes if verbose else (row.interval,))]
            shown += [(str(row.location), "cyan")] if row.location is not None and row.stands_out else []
            yield from ([(f"{indent}    ", ""), part] for part in shown if part[0])


def value_text(value: Value) -> str:
    """Return a value of a row as text."""
    if isinstance(value, Bar):
        return value.text
    return value if isinstance(value, str) else moment(value)


def expectation_rows(
    outcome: Outcome, expectations: Iterable[ExpectationOutcome], options: ReportOptions | None = None
) -> tuple[Row, ...]:
    """Return the rows of expectations; `options`: for the links to the replay."""
    return tuple(
        Row(
            expected.display_status,
            expected.name,
            outcome.message_of(expected),
            # The message of a gate has its numbers; its margin belongs to a bound, not to the measured rate.
            () if expected.assertion == GATE else numbers(expected.verdict),
            location=expected.location,
            stands_out=not is_fine,
            interval=confidence_text(expected),
            notes=(*spread_texts(expected), judged_text(expected.verdict)),
            replay="" if options is None or is_fine else replay_link(outcome, options, expected.verdict.time),
        )
        for expected, is_fine in ((expected, expected.status == "passed") for expected in expectations)
    )


def numbers(verdict: Verdict) -> tuple[str, str, str, str | float]:
    """Return measured value and limit with enough digits to differ, margin and time; empty where there is none."""
    measured, limit, margin = (
        "" if value is None else units.display(value, verdict.unit)
        for value in (verdict.measured, verdict.limit, verdict.margin)
    )
    if verdict.measured is not None and verdict.limit is not None:
        measured, limit = units.display_apart(verdict.measured, verdict.limit, verdict.unit)
    return measured, limit, margin, "" if verdict.time is None else verdict.time
