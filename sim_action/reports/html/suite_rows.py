"""The cells of the table of all scenarios: name, nearest limit with a bar of its margin, durations, folded runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Final

from sim_action.core.wording import shortened
from sim_action.reports.escaping import one_line
from sim_action.reports.formatting import moment, quantity
from sim_action.reports.html.document import Html, element, joined
from sim_action.reports.html.scenario_article import status_mark
from sim_action.reports.html.sweep import parameters
from sim_action.reports.scenario_groups import ScenarioGroup, nearest_expectation, relative_margin
from sim_action.results.outcome import ExpectationOutcome, Outcome

_MAX_TEXT: Final = 160
_MAX_VALUE: Final = 40
_HALF: Final = 50
"""Half of the width of a bar of a margin, which is 100 % of the limit."""
_LEAST_BAR: Final = 1.5
_NO_VERDICT: Final = -2.0
"""The margin by which runs without a verdict are sorted: before those that failed."""


def name_cell(outcome: Outcome, identity: str) -> Html:
    """Return the name of a scenario, linked to its article, and its file."""
    link = element("a", one_line(outcome.name), href=f"#{identity}")
    return element("th", link, _small(outcome.file), scope="row")


def group_name_cell(group: ScenarioGroup, identity: str) -> Html:
    """Return the name of a gate or of a scenario that is varied, with its counts and file.

    `identity`: the element id of its article; of its worst run if it has none.
    """
    name = one_line(group.gate.name if group.gate is not None else group.name)
    link = element("a", name, href=f"#{identity}")
    file = (group.gate or group.outcomes[0]).file
    counts = group.rate_text and f"gate: {group.rate_text}"
    told = counts or (group.gate_text if group.is_part or group.gate is not None else group.passed)
    return element("th", link, _small(f"{told} · {file}" if file else told), scope="row")


def _small(words: str) -> Html:
    return element("small", one_line(words), class_="faint") if words else Html("")


def nearest_cell(outcome: Outcome) -> Html:
    """Return the expectation nearest to its limit with its margin; for a run that did not pass, the reason."""
    expected = nearest_expectation(outcome)
    return element(
        "td",
        element("span", nearest_text(outcome, expected), class_="what") if outcome.status != "skipped" else "",
        _margin(expected) if expected is not None else "",
        class_="nearest",
    )


def nearest_text(outcome: Outcome, expected: ExpectationOutcome | None) -> str:
    """Return the reason why a run did not pass; the name of the nearest expectation if it passed."""
    if outcome.failures:
        failure = outcome.failures[0]
        return shortened(one_line(f"{failure.title}: {failure.message}"), _MAX_TEXT)
    if expected is None:
        return ""
    return shortened(one_line(expected.verdict.message if expected.status != "passed" else expected.name), _MAX_TEXT)


def _margin(expected: ExpectationOutcome) -> Html:
    """Return the margin as text with its bar; a goal that was reached has the time of this in place of a margin."""
    verdict = expected.verdict
    if verdict.status == "passed" and verdict.goal and verdict.time is not None:
        return element("span", f"reached at {moment(verdict.time)}", class_="margin")
    if verdict.margin is None or verdict.cut_off:
        return Html("")
    # A count of contacts is 0 or 1: its margin says nothing.
    words = "" if verdict.unit == "contacts" else quantity(verdict.margin, verdict.unit)
    return element("span", margin_bar(relative_margin(expected)), element("span", words), class_="margin")


def margin_bar(relative: float) -> Html:
    """Return a bar to the right for a positive relative margin, to the left for a negative one."""
    marks = [
        element("rect", x=-_HALF, width=2 * _HALF, height=8, class_="scale"),
        element("rect", x=-0.5, width=1, height=8, class_="limit"),
    ]
    if isfinite(relative):
        length = max(_LEAST_BAR, round(_HALF * min(1.0, abs(relative)), 1))
        held = relative >= 0
        marks.append(
            element("rect", x=0 if held else -length, width=length, height=8, class_="held" if held else "missed")
        )
    return element("svg", *marks, viewBox=f"{-_HALF} 0 {2 * _HALF} 8", aria_hidden="true", class_="margin-bar")


def sort_margin(outcome: Outcome) -> str | None:
    """Return the relative margin as text to sort by; None if nothing was measured."""
    expected = nearest_expectation(outcome)
    if expected is None:
        return None if outcome.status in ("passed", "skipped") else f"{_NO_VERDICT:g}"
    if expected.verdict.status == "passed" and expected.verdict.goal:
        return None
    relative = relative_margin(expected)
    return f"{relative:.4g}" if isfinite(relative) else None


def duration_cell(title: str, seconds: float, longest: float = 0.0) -> Html:
    """Return a time in s, with a bar if the longest one is given; nothing for 0."""
    if not seconds:
        return element("td", class_="duration", data_title=title)
    bar = ""
    if longest > 0:
        filled = element("rect", width=max(1.0, round(100 * seconds / longest, 1)), height=4)
        bar = element(
            "svg", filled, viewBox="0 0 100 4", preserveAspectRatio="none", aria_hidden="true", class_="share"
        )
    return element(
        "td", f"{seconds:.1f} s" if seconds < 100 else f"{seconds:.0f} s", bar, class_="duration", data_title=title
    )


def runs_table(
    group: ScenarioGroup, runs: Sequence[Outcome], ids: Mapping[int, str], paths: Mapping[int, Html]
) -> Html:
    """Return the runs of a group with their parameters as columns."""
    columns = parameters(group.outcomes)
    numbers = {id(run): number for number, run in enumerate(group.outcomes)}
    longest = max(run.wall_time for run in group.outcomes)
    titles = ("Run", *(column.label for column in columns), "Nearest limit", "Sim time", "Wall time", "Path")
    head = element("tr", element("td"), *(element("th", title, scope="col") for title in titles))
    rows = []
    for run in runs:
        number = numbers[id(run)]
        values = [
            element("td", shortened(column.texts[number], _MAX_VALUE), data_title=column.label) for column in columns
        ]
        link = element("a", f"run {number + 1}", href=f"#{ids[id(run)]}")
        rows.append(
            element(
                "tr",
                element("td", status_mark(run.display_status, neutral=run.is_sample)),
                element("th", link, scope="row"),
                *values,
                nearest_cell(run),
                duration_cell("Sim time", run.simulated),
                duration_cell("Wall time", run.wall_time, longest),
                element("td", paths.get(id(run), ""), class_="path"),
            )
        )
    table = element("table", element("thead", head), element("tbody", joined(*rows)))
    return element("div", table, class_="wide runs")
