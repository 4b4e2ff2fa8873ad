"""One scenario of the page: what became of it first, then its run, then all that was measured and said."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from urllib.parse import quote, urlsplit

from sim_action.core import units
from sim_action.core.errors import Location
from sim_action.recording.replay.replay_file import Replay
from sim_action.reports import ReportOptions
from sim_action.reports.escaping import one_line
from sim_action.reports.formatting import (
    DisplayStatus,
    display_status,
    moment,
    provenance_rows,
    quantity,
    repeats_text,
    speed_text,
    user_output,
)
from sim_action.reports.html.document import Html, element, joined
from sim_action.reports.html.top_view import drawing
from sim_action.reports.links import place, rerun_command, seen_from
from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome
from sim_action.results.results_json import Results
from sim_action.state.verdict import Verdict

WORDS: dict[DisplayStatus, str] = {
    "passed": "Passed",
    "warned": "Passed, with a warning",
    "failed": "Failed",
    "flaky": "Flaky: its runs were not the same",
    "error": "No verdict",
    "skipped": "Not run",
}


def article(identity: str, outcome: Outcome, results: Results, options: ReportOptions, still: Html) -> Html:
    """All of one scenario; `identity`: its id on the page; `still`: what stands there of its run without a script."""
    kind = display_status(outcome)
    return element(
        "article",
        element(
            "header",
            element("p", element("span", MARKS[kind], aria_hidden="true"), " ", WORDS[kind], class_=f"status {kind}"),
            element("h2", one_line(outcome.name), id=f"{identity}-name"),
            element("p", _origin_line(outcome, options), class_="faint"),
        ),
        joined(
            reasons(outcome, options),
            element("div", still, class_="stage"),
            expectations(outcome, options),
            details(outcome, results, options),
        ),
        id=identity,
        class_=f"scenario {kind}",
        aria_labelledby=f"{identity}-name",
    )


def _origin_line(outcome: Outcome, options: ReportOptions) -> Html:
    """Where it is written, on what it ran, for how long."""
    simulated = f"{moment(outcome.sim_time)} simulated" if outcome.sim_time is not None else ""
    told = [
        element("span", part)
        for part in (
            source(outcome.location, options),
            simulated,
            speed_text(outcome.real_time_factor),
            outcome.engine or "",
        )
        if part
    ]
    return Html(" · ".join(told))


def drawn(replay: Replay, outcome: Outcome) -> Html:
    """The run as a drawing, and what is to be seen on it."""
    words = "From above: the way of the robot, where it began (outlined) and where it was at the end."
    return element("figure", drawing(replay, outcome), element("figcaption", words), class_="still")


MARKS = {"passed": "✓", "warned": "!", "failed": "✕", "flaky": "≠", "error": "✕", "skipped": "·"}

_NUMBERS = ("Measured", "Limit", "Margin", "Decided")
_MAX_FAILURES = 20


def reasons(outcome: Outcome, options: ReportOptions) -> Html:
    """Why a scenario did not pass: what was measured, against what, when, and by how much that missed."""
    causes = [expected for expected in outcome.causes_first if not expected.verdict.passed]
    told = [_failure_section(failure, options) for failure in outcome.failures[:_MAX_FAILURES]]
    told += [_missed_section(expected) for expected in causes]
    left = len(outcome.failures) - _MAX_FAILURES
    more = element("p", f"{left} more errors are in results.json.", class_="faint") if left > 0 else ""
    return element("div", joined(*told, more), class_="reasons") if told else Html("")


def expectations(outcome: Outcome, options: ReportOptions) -> Html:
    """All of them, in the order of the scenario file, as a table."""
    if not outcome.expectations:
        return Html("")
    head = element("tr", *(element("th", title, scope="col") for title in ("", "Expectation", *_NUMBERS)))
    rows = [_expectation_row(expected, options) for expected in outcome.expectations]
    table = element("table", element("thead", head), element("tbody", joined(*rows)))
    return joined(element("h3", "Expectations"), element("div", table, class_="wide"))


def _moment_link(time: float | None) -> Html:
    """The moment at which something was decided, to go to where there is a replay."""
    return Html("") if time is None else element("span", moment(time), class_="moment", data_time=time)


def _failure_section(failure: Failure, options: ReportOptions) -> Html:
    return element(
        "section",
        element("h3", failure.title),
        element("p", failure.message, class_="what"),
        _named_figures({"at": _moment_link(failure.time)}),
        element("p", source(failure.location, options), class_="faint") if failure.location else "",
        element("pre", failure.details) if failure.details.strip() else "",
        class_="reason failed",
    )


def _missed_section(expected: ExpectationOutcome) -> Html:
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
    return _named_figures({"measured": measured, "limit": limit, "missed by": missed, "at": _moment_link(verdict.time)})


def _named_figures(named: Mapping[str, str]) -> Html:
    """Those that there are."""
    told = [element("div", element("dt", name), element("dd", value)) for name, value in named.items() if value]
    return element("dl", *told, class_="figures") if told else Html("")


def _expectation_row(expected: ExpectationOutcome, options: ReportOptions) -> Html:
    verdict = expected.verdict
    kind = "passed" if verdict.passed else "warned" if expected.warned else "failed"
    measured, limit = _apart(verdict)
    margin = "" if verdict.margin is None else units.display(verdict.margin, verdict.unit)
    cells = dict(zip(_NUMBERS, (measured, limit, margin, _moment_link(verdict.time)), strict=True))
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


_MAX_LINES = 200


def details(outcome: Outcome, results: Results, options: ReportOptions) -> Html:
    """The command that runs it again, what it ran on, and what was said meanwhile."""
    said = [(diagnostic.level, diagnostic.message) for diagnostic in outcome.diagnostics]
    return joined(
        _again(outcome, options),
        _said("Engine", said),
        _said("Notes", [("note", note) for note in outcome.notes]),
        _printed(user_output(outcome)),
        _facts(outcome, results),
    )


def _again(outcome: Outcome, options: ReportOptions) -> Html:
    told = rerun_command(outcome, options)
    if not told:
        return Html("")
    shown = element("pre", element("code", told))
    return joined(element("h3", "Run it again"), element("div", shown, class_="command"))


def _said(title: str, remarks: Sequence[tuple[str, str]]) -> Html:
    if not remarks:
        return Html("")
    items = [
        element("li", element("b", level, " ") if level != "note" else "", message)
        for level, message in remarks[:_MAX_LINES]
    ]
    left = len(remarks) - _MAX_LINES
    more = [element("li", f"{left} more are in results.json")] if left > 0 else []
    return joined(element("h3", title), element("ul", *items, *more, class_="remarks"))


def _printed(output: str) -> Html:
    if not output.strip():
        return Html("")
    return joined(element("h3", "Printed by your code"), element("pre", output, tabindex="0"))


def _wall_time(outcome: Outcome) -> str:
    """Its speed is that of the loop alone: nobody is to multiply the two."""
    if not outcome.wall_time:
        return ""
    runs = f", of all {outcome.repeats.count} runs" if outcome.repeats else ""
    return f"{quantity(outcome.wall_time, 's')} from start to end{runs}"


def _facts(outcome: Outcome, results: Results) -> Html:
    named = {
        "variation": ", ".join(f"{varied.key} = {varied.value}" for varied in outcome.variation),
        "ended by": outcome.end or "",
        "sim time": quantity(outcome.sim_time, "s"),
        "speed": speed_text(outcome.real_time_factor),
        "wall time": _wall_time(outcome),
        "travelled": quantity(outcome.travelled, "m"),
        "engine": outcome.engine or "",
        "seed": "" if outcome.seed is None else str(outcome.seed),
        "digest": outcome.digest or "",
        "repeated": repeats_text(outcome),
        **(
            provenance_rows(outcome.provenance)
            or {"made by": f"sim-action {results.sim_action}, Python {results.python}"}
        ),
        "trace": outcome.trace or "",
        "recordings": ", ".join(outcome.recordings),
    }
    told = [element("div", element("dt", name), element("dd", value)) for name, value in named.items() if value]
    return joined(element("h3", "How it ran"), element("dl", *told, class_="facts"))


def source(location: Location | None, options: ReportOptions) -> Html:
    """`path:line`; a link to the file at this commit where that is known; empty of no place."""
    if location is None:
        return Html("")
    shown = element("code", place(options.workspace, location))
    path = seen_from(options.workspace, location.file)
    names = ("GITHUB_SERVER_URL", "GITHUB_REPOSITORY", "GITHUB_SHA")
    server, repository, commit = (options.environment.get(name, "") for name in names)
    if urlsplit(server).scheme not in ("http", "https") or not (repository and commit) or path.startswith("/"):
        return shown
    line = "" if location.line is None else f"#L{location.line}"
    address = f"{server}/{repository}/blob/{commit}/{quote(path, errors='replace')}{line}"
    return element("a", shown, href=address, rel="noreferrer")
