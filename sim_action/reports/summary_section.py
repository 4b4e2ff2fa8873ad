"""What the job summary says of one scenario."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Final

from sim_action.outcome import ExpectationOutcome, Failure, Outcome
from sim_action.reports import ReportOptions
from sim_action.reports.escaping import markdown_block, markdown_text, shortened
from sim_action.reports.groups import Group
from sim_action.reports.markdown import code, folded, row, source_link, table
from sim_action.reports.wording import Mood, factor, moment, mood, own_output, quantity

ICONS: Final[dict[Mood, str]] = {"passed": "✅", "warned": "⚠️", "failed": "❌", "error": "💥", "skipped": "⏭️"}

_MOST_ROWS: Final = 100
_MOST_FAILURES: Final = 20
_MOST_IN_MESSAGE: Final = 500
_MOST_IN_BLOCK: Final = 4_000
_MOST_REMARKS: Final = 50
_DIGEST_DIGITS: Final = 12


def section(group: Group, options: ReportOptions) -> str:
    """A heading, what did not hold or why there is no verdict, everything measured; how it ran is folded."""
    return _varied(group, options) if group.varies else _outcome(group.worst, options)


def gist(group: Group) -> str:
    """The one thing to know about a scenario, as Markdown."""
    if not group.varies:
        return _gist(group.worst)
    worst = (
        f"; worst: {markdown_text(group.values(group.worst))} {_gist(group.worst)}" if group.mood != "passed" else ""
    )
    return f"{group.passed}{worst}"


def sim_time(group: Group) -> float | None:
    """In s, of all that was simulated; None if nothing was."""
    times = [outcome.sim_time for outcome in group.outcomes if outcome.sim_time is not None]
    return sum(times) if times else None


def _varied(group: Group, options: ReportOptions) -> str:
    """A table of its variations, in which those that passed are folded, and all about the worst, if one did not."""
    ordered = group.worst_first()
    unhappy = [outcome for outcome in ordered if mood(outcome) != "passed"]
    rows = [
        row(ICONS[mood(outcome)], markdown_text(group.values(outcome)), _gist(outcome), moment(outcome.sim_time))
        for outcome in ordered[: max(len(unhappy), _MOST_ROWS)]
    ]
    columns = ("", "Variation", "What happened", " Sim time")
    bad, good = rows[: len(unhappy)][:_MOST_ROWS], rows[len(unhappy) :]
    parts = [
        f"### {ICONS[group.mood]} {markdown_text(group.name)}: {group.passed}",
        source_link(options, group.location),
        table(columns, bad) if bad else "",
        folded(f"{len(ordered) - len(unhappy)} variations that passed", table(columns, good)) if good else "",
        _left_out(len(ordered), len(bad) + len(good), "variations"),
        _outcome(group.worst, options) if group.mood not in ("passed", "skipped") else "",
    ]
    return "\n\n".join(part for part in parts if part)


def _outcome(outcome: Outcome, options: ReportOptions) -> str:
    parts = [
        f"### {ICONS[mood(outcome)]} {markdown_text(outcome.name)}",
        _subtitle(outcome, options),
        *(_failure(failure, options) for failure in outcome.failures[:_MOST_FAILURES]),
        _left_out(len(outcome.failures), _MOST_FAILURES, "errors"),
        _expectations(outcome, options),
        _run_details(outcome),
    ]
    return "\n\n".join(part for part in parts if part)


def _gist(outcome: Outcome) -> str:
    if outcome.status == "skipped":
        return _message(" ".join(outcome.notes))
    reasons = [f"{failure.title}: {failure.message}" for failure in outcome.failures]
    reasons += [expected.verdict.message for expected in outcome.causes_first if expected.failed]
    reasons = reasons or [expected.verdict.message for expected in outcome.causes_first if expected.warned]
    if reasons:
        more = f" <sub>(and {len(reasons) - 1} more)</sub>" if len(reasons) > 1 else ""
        return _message(reasons[0]) + more
    if len(outcome.expectations) == 1:
        return _message(outcome.expectations[0].verdict.message)
    return f"{len(outcome.expectations)} expectations held"


def _subtitle(outcome: Outcome, options: ReportOptions) -> str:
    simulated = f"{moment(outcome.sim_time)} simulated" if outcome.sim_time is not None else ""
    ended = markdown_text(f"ended by: {outcome.end}") if outcome.end else ""
    parts = (source_link(options, outcome.location), simulated, ended, factor(outcome.real_time_factor))
    return " · ".join(part for part in parts if part)


def _failure(failure: Failure, options: ReportOptions) -> str:
    said = f"**{markdown_text(shortened(failure.title, _MOST_IN_MESSAGE))}**: {_message(failure.message)}"
    if failure.location is not None:
        said += f"<br>\n{source_link(options, failure.location)}"
    if failure.details.strip():
        said += f"\n\nLast words:\n\n{_ending_block(failure.details)}"
    return said


def _expectations(outcome: Outcome, options: ReportOptions) -> str:
    worst_first = sorted(outcome.causes_first, key=lambda expected: (not expected.failed, not expected.warned))
    if not worst_first:
        return ""
    rows = (_row(expected, options) for expected in worst_first[:_MOST_ROWS])
    columns = ("", "Expectation", " Measured", " Limit", " Margin", " At")
    left_out = _left_out(len(worst_first), _MOST_ROWS, "expectations")
    return table(columns, rows) + (f"\n\n{left_out}" if left_out else "")


def _row(expected: ExpectationOutcome, options: ReportOptions) -> str:
    verdict = expected.verdict
    icon = ICONS["passed" if verdict.passed else "failed" if expected.failed else "warned"]
    what = f"**{markdown_text(expected.name)}**<br>{_message(verdict.message)}"
    if not verdict.passed:
        what += f"<br>{source_link(options, expected.location)}"
    numbers = (quantity(value, verdict.unit) for value in (verdict.measured, verdict.limit, verdict.margin))
    return row(icon, what, *(markdown_text(number) for number in numbers), moment(verdict.time))


def _run_details(outcome: Outcome) -> str:
    items = [f"- {remark}" for remark in _remarks(outcome)]
    if output := own_output(outcome):
        items.append(f"\nOutput:\n\n{_ending_block(output)}")
    if not items:
        return ""
    return folded("How it ran", "\n".join(items))


def _remarks(outcome: Outcome) -> Iterator[str]:
    if outcome.engine:
        yield f"engine: {markdown_text(outcome.engine)}"
    if outcome.seed:
        yield f"seed: {outcome.seed}"
    if outcome.digest:
        yield f"digest: {code(outcome.digest[:_DIGEST_DIGITS])}"
    for varied in outcome.variation:
        yield f"{code(varied.key)}: {code(json.dumps(varied.value))}"
    if outcome.trace:
        yield f"trace: {code(outcome.trace)}"
    for note in outcome.notes[:_MOST_REMARKS]:
        yield f"note: {_message(note)}"
    for diagnostic in outcome.diagnostics[:_MOST_REMARKS]:
        yield f"{diagnostic.level} of the engine: {_message(diagnostic.message)}"


def _message(text: str) -> str:
    return markdown_text(shortened(text, _MOST_IN_MESSAGE))


def _ending_block(text: str) -> str:
    """The end of a text is where the cause stands."""
    return markdown_block(text if len(text) <= _MOST_IN_BLOCK else f"…{text[-_MOST_IN_BLOCK:]}")


def _left_out(total: int, most: int, what: str) -> str:
    return f"_{total - most} more {what} are left out here._" if total > most else ""
