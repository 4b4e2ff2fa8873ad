"""One scenario of the page: what became of it first, then its run, then all that was measured and said."""

from __future__ import annotations

from sim_action.recording.replay import Replay
from sim_action.reports import ReportOptions
from sim_action.reports.escaping import one_line
from sim_action.reports.page.details import details
from sim_action.reports.page.drawing import drawing
from sim_action.reports.page.markup import Html, element, joined
from sim_action.reports.page.sources import source
from sim_action.reports.page.verdicts import MARKS, expectations, reasons
from sim_action.reports.wording import Mood, factor, moment, mood
from sim_action.results.file import Results
from sim_action.results.outcome import Outcome

WORDS: dict[Mood, str] = {
    "passed": "Passed",
    "warned": "Passed, with a warning",
    "failed": "Failed",
    "flaky": "Flaky: its runs were not the same",
    "error": "No verdict",
    "skipped": "Not run",
}


def article(identity: str, outcome: Outcome, results: Results, options: ReportOptions, still: Html) -> Html:
    """All of one scenario; `identity`: its id on the page; `still`: what stands there of its run without a script."""
    kind = mood(outcome)
    return element(
        "article",
        element(
            "header",
            element("p", element("span", MARKS[kind], aria_hidden="true"), " ", WORDS[kind], class_=f"status {kind}"),
            element("h2", one_line(outcome.name), id=f"{identity}-name"),
            element("p", _line(outcome, options), class_="faint"),
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


def _line(outcome: Outcome, options: ReportOptions) -> Html:
    """Where it is written, on what it ran, for how long."""
    simulated = f"{moment(outcome.sim_time)} simulated" if outcome.sim_time is not None else ""
    told = [
        element("span", part)
        for part in (
            source(outcome.location, options),
            simulated,
            factor(outcome.real_time_factor),
            outcome.engine or "",
        )
        if part
    ]
    return Html(" · ".join(told))


def drawn(replay: Replay, outcome: Outcome) -> Html:
    """The run as a drawing, and what is to be seen on it."""
    words = "From above: the way of the robot, where it began (outlined) and where it was at the end."
    return element("figure", drawing(replay, outcome), element("figcaption", words), class_="still")
