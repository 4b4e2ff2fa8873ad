"""What was expected of one scenario and what came of it, in words and numbers."""

from __future__ import annotations

from collections.abc import Mapping

from sim_action.core import units
from sim_action.reports import ReportOptions
from sim_action.reports.page.markup import Html, element, joined
from sim_action.reports.page.sources import source
from sim_action.reports.wording import moment
from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome
from sim_action.state.verdict import Verdict

MARKS = {"passed": "✓", "warned": "!", "failed": "✕", "flaky": "≠", "error": "✕", "skipped": "·"}

_NUMBERS = ("Measured", "Limit", "Margin", "Decided")
_MOST_FAILURES = 20


def reasons(outcome: Outcome, options: ReportOptions) -> Html:
    """Why a scenario did not pass: what was measured, against what, when, and by how much that missed."""
    causes = [expected for expected in outcome.causes_first if not expected.verdict.passed]
    told = [_failure(failure, options) for failure in outcome.failures[:_MOST_FAILURES]]
    told += [_reason(expected) for expected in causes]
    left = len(outcome.failures) - _MOST_FAILURES
    more = element("p", f"{left} more errors are in results.json.", class_="faint") if left > 0 else ""
    return element("div", joined(*told, more), class_="reasons") if told else Html("")


def expectations(outcome: Outcome, options: ReportOptions) -> Html:
    """All of them, in the order of the scenario file, as a table."""
    if not outcome.expectations:
        return Html("")
    head = element("tr", *(element("th", title, scope="col") for title in ("", "Expectation", *_NUMBERS)))
    rows = [_row(expected, options) for expected in outcome.expectations]
    table = element("table", element("thead", head), element("tbody", joined(*rows)))
    return joined(element("h3", "Expectations"), element("div", table, class_="wide"))


def jump(time: float | None) -> Html:
    """The moment at which something was decided, to go to where there is a replay."""
    return Html("") if time is None else element("span", moment(time), class_="moment", data_time=time)


def _failure(failure: Failure, options: ReportOptions) -> Html:
    return element(
        "section",
        element("h3", failure.title),
        element("p", failure.message, class_="what"),
        _named_figures({"at": jump(failure.time)}),
        element("p", source(failure.location, options), class_="faint") if failure.location else "",
        element("pre", failure.details) if failure.details.strip() else "",
        class_="reason failed",
    )


def _reason(expected: ExpectationOutcome) -> Html:
    verdict = expected.verdict
    kind = "warned" if expected.warned else "failed"
    cut = "Not decided: something else ended the run first." if verdict.cut_off else ""
    return element(
        "section",
        element("h3", expected.name, element("small", " · a warning") if expected.warned else ""),
        element("p", verdict.message or "It did not hold.", class_="what"),
        _figures(verdict),
        element("p", cut, class_="faint") if cut else "",
        class_=f"reason {'cut' if verdict.cut_off else kind}",
    )


def _figures(verdict: Verdict) -> Html:
    """Measured, limit, missed by, when: only what there is."""
    measured, limit = _apart(verdict)
    # What is counted is missed by as much as is measured.
    margin = 0.0 if verdict.margin is None or verdict.unit == "contacts" else verdict.margin
    missed = units.display(-margin, verdict.unit) if margin < 0 else ""
    return _named_figures({"measured": measured, "limit": limit, "missed by": missed, "at": jump(verdict.time)})


def _named_figures(named: Mapping[str, str]) -> Html:
    """Those that there are."""
    told = [element("div", element("dt", name), element("dd", value)) for name, value in named.items() if value]
    return element("dl", *told, class_="figures") if told else Html("")


def _row(expected: ExpectationOutcome, options: ReportOptions) -> Html:
    verdict = expected.verdict
    kind = "passed" if verdict.passed else "warned" if expected.warned else "failed"
    measured, limit = _apart(verdict)
    margin = "" if verdict.margin is None else units.display(verdict.margin, verdict.unit)
    cells = dict(zip(_NUMBERS, (measured, limit, margin, jump(verdict.time)), strict=True))
    place = element("small", source(expected.location, options), class_="faint")
    return element(
        "tr",
        element("td", element("span", MARKS[kind], class_=f"mark {kind}", role="img", aria_label=kind)),
        element("th", element("span", expected.name), " ", place, scope="row"),
        *(element("td", told, data_title=title) for title, told in cells.items()),
    )


def _apart(verdict: Verdict) -> tuple[str, str]:
    """Measured value and limit, told apart; empty where there is none."""
    if verdict.measured is not None and verdict.limit is not None:
        return units.display_apart(verdict.measured, verdict.limit, verdict.unit)
    measured, limit = ("" if v is None else units.display(v, verdict.unit) for v in (verdict.measured, verdict.limit))
    return measured, limit
