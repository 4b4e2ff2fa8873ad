"""What there is to say of a comparison, worst first, before it is written for a terminal or as Markdown."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, Literal

from sim_action.reports.wording import factor, measurements, quantity
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
    found = [row for change in comparison.changes for row in _rows_of(change)]
    return sorted(found, key=lambda row: _ORDER.index(row.look))


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
        yield Row(look, change.turn, change.outcome, _told(change))
    for missed in change.missed:
        yield Row("warning", "holds no longer", change.outcome, f"{missed.name}: {missed.verdict.message}")
    for shrunk in change.shrunk:
        yield Row("warning", "margin shrinks", change.outcome, _shrunk(shrunk))
    elsewhere = "" if change.processors is None else " (on another machine: {}, now {})".format(*change.processors)
    if slower := change.slower:
        told = f"{factor(slower.old)}, now {factor(slower.new)}{elsewhere}"
        yield Row("note" if elsewhere else "warning", "slower", change.outcome, told)
    # Of a verdict that is another one, it is no news.
    if change.behaves_otherwise and change.turn in ("still passes", "still fails"):
        told = f"another digest with the same seed, on the same engine{elsewhere}"
        yield Row("note", "moves otherwise", change.outcome, told)


def _told(change: Change) -> str:
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


def _shrunk(shrunk: Shrunk) -> str:
    """Such as "clearance: 0.4 m (27 % of its limit), now 0.1 m (7 %)"."""
    old, new = (quantity(value, shrunk.unit) for value in (shrunk.old, shrunk.new))
    of_old = "" if shrunk.old_share is None else f" ({shrunk.old_share:.0%} of its limit)"
    of_new = "" if shrunk.new_share is None else f" ({shrunk.new_share:.0%})"
    return f"{shrunk.expectation}: margin {old}{of_old}, now {new}{of_new}"
