"""What the job summary says of one scenario."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Final

from sim_action.core.messages import counted
from sim_action.recording.replay.models import Replay
from sim_action.reports import ReportOptions
from sim_action.reports.escaping import markdown_block, markdown_text, shortened
from sim_action.reports.evidence import curve, replay_of
from sim_action.reports.groups import Group
from sim_action.reports.markdown import code, code_of_link, folded, row, shell_block, source_link, table
from sim_action.reports.mermaid import chart
from sim_action.reports.reproduction import command, replay_link
from sim_action.reports.wording import Mood, factor, made_with, moment, mood, own_output, quantity, repeated
from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome

ICONS: Final[dict[Mood, str]] = {
    "passed": "✅",
    "warned": "⚠️",
    "failed": "❌",
    "flaky": "🎲",
    "error": "💥",
    "skipped": "⏭️",
}

_MOST_ROWS: Final = 100
_MOST_FAILURES: Final = 20
_MOST_IN_MESSAGE: Final = 500
_MOST_IN_BLOCK: Final = 4_000
_MOST_REMARKS: Final = 50
_MOST_CHARTS: Final = 2
_DIGEST_DIGITS: Final = 12


def section(group: Group, options: ReportOptions, *, drawn: bool = False) -> str:
    """A heading, what did not hold or why there is no verdict, everything measured; how it ran is folded.

    `drawn`: whether what did not hold is also shown in charts, where the run has left what they are made of.
    """
    return _varied(group, options, drawn=drawn) if group.varies else _outcome(group.worst, options, drawn=drawn)


def gist(group: Group) -> str:
    """The one thing to know about a scenario, as Markdown."""
    if not group.varies:
        return _gist(group.worst)
    if group.mood == "passed":
        return headline(group)
    return f"{group.passed}; worst: {markdown_text(group.values(group.worst))} {_gist(group.worst)}"


def headline(group: Group) -> str:
    """How many of its variations passed, and how near the worst of them came to its limit, as Markdown."""
    worst = f"; worst: {markdown_text(group.worst_told)}" if group.mood != "skipped" else ""
    return f"{group.passed}{worst}"


def sim_time(group: Group) -> float | None:
    """In s, of all that was simulated; None if nothing was."""
    times = [outcome.sim_time for outcome in group.outcomes if outcome.sim_time is not None]
    return sum(times) if times else None


def _varied(group: Group, options: ReportOptions, *, drawn: bool) -> str:
    """A table of its variations, in which those that passed are folded, and all about the worst, if one did not."""
    ordered = group.worst_first()
    unhappy = [outcome for outcome in ordered if mood(outcome) != "passed"]
    rows = [
        row(ICONS[mood(outcome)], markdown_text(group.values(outcome)), _gist(outcome), moment(outcome.sim_time))
        for outcome in ordered[: max(len(unhappy), _MOST_ROWS)]
    ]
    columns = ("", "Variation", "What happened", " Sim time")
    passed = f"{counted(len(ordered) - len(unhappy), 'variation')} that passed"
    bad, good = rows[: len(unhappy)][:_MOST_ROWS], rows[len(unhappy) :]
    parts = [
        f"### {ICONS[group.mood]} {markdown_text(group.name)}: {headline(group)}",
        source_link(options, group.location),
        table(columns, bad) if bad else "",
        folded(passed, table(columns, good)) if good else "",
        _left_out(len(ordered), len(bad) + len(good), "variation"),
        _outcome(group.worst, options, drawn=drawn) if group.mood not in ("passed", "skipped") else "",
    ]
    return "\n\n".join(part for part in parts if part)


def _outcome(outcome: Outcome, options: ReportOptions, *, drawn: bool) -> str:
    parts = [
        f"### {ICONS[mood(outcome)]} {markdown_text(outcome.name)}",
        _subtitle(outcome, options),
        *(_failure(failure, options) for failure in outcome.failures[:_MOST_FAILURES]),
        _left_out(len(outcome.failures), _MOST_FAILURES, "error"),
        _expectations(outcome, options),
        *(_charts(outcome, options) if drawn else ()),
        _reproduction(outcome, options),
        _run_details(outcome),
    ]
    return "\n\n".join(part for part in parts if part)


def _charts(outcome: Outcome, options: ReportOptions) -> Iterator[str]:
    """Of what did not hold, beginning with what makes the scenario fail."""
    numbered = sorted(enumerate(outcome.expectations), key=lambda pair: (pair[1].verdict.cut_off, not pair[1].failed))
    missed = [(number, expected) for number, expected in numbered if not expected.verdict.passed]
    replay = replay_of(outcome, options) if missed else None
    drawings = (_chart(replay, number, expected) for number, expected in missed) if replay else ()
    yield from islice((drawing for drawing in drawings if drawing), _MOST_CHARTS)


def _chart(replay: Replay, number: int, expected: ExpectationOutcome) -> str:
    signal = curve(replay, number, expected.verdict)
    drawing = "" if signal is None else chart(signal, expected.verdict.time)
    return f"**{markdown_text(expected.name)}** over time:\n\n{drawing}" if drawing else ""


def _reproduction(outcome: Outcome, options: ReportOptions) -> str:
    """What is of use to whoever has to mend something."""
    if mood(outcome) in ("passed", "skipped") or not (typed := command(outcome, options)):
        return ""
    return f"To run it again:\n\n{shell_block(typed)}"


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
    engine, speed = markdown_text(outcome.engine or ""), factor(outcome.real_time_factor)
    parts = (source_link(options, outcome.location), simulated, ended, speed, engine, repeated(outcome))
    return " · ".join(part for part in parts if part)


def _failure(failure: Failure, options: ReportOptions) -> str:
    said = f"**{markdown_text(shortened(failure.title, _MOST_IN_MESSAGE))}**: {_message(failure.message)}"
    if failure.location is not None:
        said += f"<br>\n{source_link(options, failure.location)}"
    if failure.details.strip():
        said += f"\n\nLast words:\n\n{_ending_block(failure.details)}"
    return said


def _expectations(outcome: Outcome, options: ReportOptions) -> str:
    """What did not hold; what did is folded, if there is both."""
    ordered = sorted(outcome.causes_first, key=lambda expected: not expected.failed)
    missed = [expected for expected in ordered if not expected.verdict.passed]
    held = [expected for expected in ordered if expected.verdict.passed]
    if not missed or not held:
        return _table(outcome, missed or held, options)
    return "\n\n".join(
        (
            _table(outcome, missed, options),
            folded(
                f"{counted(len(held), 'expectation')} held",
                _table(outcome, held, options),
            ),
        )
    )


def _table(outcome: Outcome, expectations: Sequence[ExpectationOutcome], options: ReportOptions) -> str:
    if not expectations:
        return ""
    rows = (_row(outcome, expected, options) for expected in expectations[:_MOST_ROWS])
    columns = ("", "Expectation", " Measured", " Limit", " Margin", " At")
    left_out = _left_out(len(expectations), _MOST_ROWS, "expectation")
    return table(columns, rows) + (f"\n\n{left_out}" if left_out else "")


def _row(outcome: Outcome, expected: ExpectationOutcome, options: ReportOptions) -> str:
    verdict = expected.verdict
    icon = ICONS["passed" if verdict.passed else "failed" if expected.failed else "warned"]
    what = f"**{markdown_text(expected.name)}**<br>{_message(verdict.message)}"
    if not verdict.passed:
        what += f"<br>{source_link(options, expected.location)}"
        if link := replay_link(outcome, options, verdict.time):
            what += f"<br>replay: {code_of_link(link)}"
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
    for name, told in made_with(outcome.provenance).items():
        yield f"{name}: {markdown_text(told)}"
    if outcome.seed is not None:
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
    if total <= most:
        return ""
    return f"_{counted(total - most, f'more {what}')} {'is' if total - most == 1 else 'are'} left out here._"
