"""The pages of `view --live`: the progress of a running call, and the report of finished scenarios.

A script of their own (`viewer/live.js`) asks the server for the state, which is JSON. Every text in the state is shown
as text.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from math import isfinite
from typing import Final, Self

from sim_action.core.records import dataclass, replace
from sim_action.core.wording import counted
from sim_action.reports import ReportOptions
from sim_action.reports.display import STATUS_DISPLAYS
from sim_action.reports.escaping import one_line
from sim_action.reports.formatting import first_message
from sim_action.reports.html.document import Html, Page, element, encoded, joined, page_json
from sim_action.reports.html.report import page
from sim_action.reports.links import fragment
from sim_action.results.artifacts import namesake_number
from sim_action.results.journal import JournalFollower, Recorded
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results

MAX_ROWS: Final = 500  # the number of scenarios in each list of the progress page; further ones are only counted
_MAX_REASON: Final = 200
_MIN_TIME_S: Final = 0.5
_GOOD: Final = frozenset({"passed", "warned"})


def live_state(follower: JournalFollower) -> dict[str, object]:
    """Return the state of a call, for the script."""
    recorded = follower.recorded
    state: dict[str, object] = {
        "call": follower.call,
        "version": version(follower),
        "hasMore": follower.has_more,
        "problem": follower.problem,
        "isOver": follower.is_over,
        "elapsed": round(follower.elapsed, 1),
    }
    if recorded is None:
        return state
    planned = recorded.header.planned
    judged = _judged(recorded)
    statuses = Counter(outcome.display_status for _, outcome in judged)
    return state | {
        "noun": _noun(recorded),
        "total": len(planned),
        "finished": len(recorded.finished),
        "left": None if follower.is_over else _time_left(recorded, follower.elapsed),
        "counts": [
            [kind, display.symbol, f"{number} {display.word}"]
            for kind, display in STATUS_DISPLAYS.items()
            if (number := statuses[kind])
        ],
        "lists": _lists(recorded, judged, is_over=follower.is_over),
    }


def _noun(recorded: Recorded) -> str:
    return "run" if recorded.header.gates else "scenario"


def _judged(recorded: Recorded) -> list[tuple[int, Outcome]]:
    """Return the final outcomes that count, each with its place: gates instead of their runs."""
    judged = [
        (place, record.outcome)
        for place, record in recorded.finished.items()
        if record.outcome is not None and record.outcome.gate is None
    ]
    if recorded.header.gates:
        places = {(planned.file, planned.gate): place for place, planned in enumerate(recorded.header.planned)}
        gates = (outcome for outcome in recorded.results_so_far().outcomes if outcome.statistics is not None)
        judged += [(places[gate.file, gate.name], gate) for gate in gates]
    return judged


def version(follower: JournalFollower) -> str:
    """Return a word that changes with every record."""
    records = 0 if follower.recorded is None else len(follower.recorded.records)
    return f"{follower.call}.{records}.{int(follower.has_more)}"


def _time_left(recorded: Recorded, elapsed: float) -> float | None:
    """Return the estimated time in s until the end, from scenarios that ran; None if too little is known."""
    done = sum(not record.taken_over for record in recorded.finished.values())
    waiting = len(recorded.header.planned) - len(recorded.finished)
    if not done or elapsed < _MIN_TIME_S:
        return None
    left = elapsed / done * waiting
    # The times of a journal may come from anywhere.
    return round(left, 1) if isfinite(left) else None


def _lists(recorded: Recorded, judged: Sequence[tuple[int, Outcome]], *, is_over: bool) -> list[dict[str, object]]:
    """Return the scenarios by their state: running, without a pass, passed (the newest first), waiting."""
    started: dict[int, float] = {}
    ended: Counter[int] = Counter()
    for record in recorded.records:
        if record.place is not None and record.event == "started":
            started.setdefault(record.place, record.at)
        elif record.place is not None and record.event == "run":
            ended[record.place] += 1
    unfinished = [place for place in range(len(recorded.header.planned)) if place not in recorded.finished]
    bad = [(place, outcome) for place, outcome in judged if outcome.display_status not in _GOOD]
    good = [(place, outcome) for place, outcome in reversed(judged) if outcome.display_status in _GOOD]
    samples = [
        (place, record.outcome)
        for place, record in reversed(recorded.finished.items())
        if record.outcome is not None and record.outcome.gate is not None
    ]
    running = [place for place in unfinished if place in started]
    waiting = [place for place in unfinished if place not in started]
    lists = [
        _list(
            "Not finished" if is_over else "Running",
            len(running),
            (_unfinished(recorded, place, started[place], ended[place]) for place in running[:MAX_ROWS]),
        ),
        _list("Did not pass", len(bad), (_finished(*row) for row in bad[:MAX_ROWS])),
        _list("Passed", len(good), (_finished(*row) for row in good[:MAX_ROWS])),
    ]
    if samples:
        lists.append(_list("Runs of gates", len(samples), (_finished(*row) for row in samples[:MAX_ROWS])))
    last = (_unfinished(recorded, place, None, 0) for place in waiting[:MAX_ROWS])
    return [*lists, _list("Not started" if is_over else "Waiting", len(waiting), last)]


def _list(title: str, count: int, rows: Iterable[Mapping[str, object]]) -> dict[str, object]:
    return {"title": title, "count": count, "rows": list(rows)}


def _unfinished(recorded: Recorded, place: int, since: float | None, runs: int) -> dict[str, object]:
    planned = recorded.header.planned[place]
    progress = "" if not runs else "1 run has ended" if runs == 1 else f"{runs} runs have ended"
    return {
        "place": place,
        "name": one_line(planned.name),
        "file": one_line(planned.file),
        "since": since,
        "why": progress,
    }


def _finished(place: int, outcome: Outcome) -> dict[str, object]:
    display = STATUS_DISPLAYS[outcome.display_status]
    number = 1 if outcome.replay is None else namesake_number(outcome.name, outcome.replay)
    return {
        "place": place,
        "name": one_line(outcome.name),
        "file": one_line(outcome.file),
        "status": outcome.display_status,
        "symbol": display.symbol,
        "word": display.word,
        "why": first_message(outcome, _MAX_REASON),
        "took": round(outcome.wall_time, 1),
        "link": f"report{fragment(outcome.name, None, number)}",
    }


def progress_page() -> Page:
    """Return the page that shows the progress; its script fills it."""
    head = element("header", element("h1", "Waiting for a run", id="live-title"), class_="run")
    content = joined(
        element("noscript", "This page needs scripts: it shows what changes."),
        element("p", "", class_="faint", id="live-clock"),
        element("progress", max=1, value=0, aria_label="Finished scenarios", id="live-bar"),
        element("p", "", role="status", id="live-counts"),
        element("p", "", class_="faint", hidden=True, id="live-problem"),
        element("p", element("a", "Open the report", href="report"), hidden=True, id="live-report"),
        element("div", "", id="live-lists"),
    )
    body = encoded(f"{head}{element('main', content, class_='progress')}")
    return Page("Progress · sim-action", False, [body], page_json({"scenarios": []}), {}, False, is_live=True)


@dataclass(frozen=True, slots=True)
class Finished:
    """The part of a call that has finished."""

    call: int  # the number of the call
    finished: int  # finished, total: the numbers of scenarios, or of runs
    total: int
    noun: str  # the word for one of them
    is_over: bool  # True if the call has ended

    @classmethod
    def of(cls, follower: JournalFollower) -> Self:
        """Return the finished part of the call, as last read."""
        recorded = follower.recorded
        if recorded is None:
            return cls(follower.call, 0, 0, "scenario", is_over=False)
        planned = len(recorded.header.planned)
        return cls(follower.call, len(recorded.finished), planned, _noun(recorded), follower.is_over)

    @property
    def scope(self) -> str:
        """The part of the call that the report has; empty for all of it."""
        if self.is_over:
            return ""
        return f"This report has {self.finished} of {counted(self.total, self.noun)} so far."


def live_report(results: Results, finished: Finished, options: ReportOptions) -> Page:
    """Return the report of the scenarios that have finished, with a line that offers newer results."""
    made = page(results, options)
    bar = element(
        "div",
        element("a", "Progress", href="./"),
        element("span", finished.scope),
        element("span", "", role="status", id="live-news"),
        element("button", "Update", type="button", hidden=True, id="live-update"),
        element("label", element("input", type="checkbox", id="live-follow"), Html(" update by itself")),
        class_="live-line",
        data_call=str(finished.call),
        data_finished=str(finished.finished),
        data_over=str(int(finished.is_over)),
    )
    return replace(made, body=(encoded(bar), *made.body), is_live=True)
