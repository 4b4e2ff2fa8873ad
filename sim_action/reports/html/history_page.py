"""The page of `sim-action report --history`: the margin of each expectation over runs, and the commit that broke it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Final

from sim_action.core.errors import UsageError
from sim_action.core.files import whole_file
from sim_action.core.records import dataclass
from sim_action.core.wording import counted, escaped_line
from sim_action.core.workspace import compared_name
from sim_action.reports.escaping import one_line
from sim_action.reports.formatting import quantity
from sim_action.reports.html.document import (
    Html,
    article,
    element,
    faint,
    heading,
    html_table,
    joined,
    page_header,
    reason,
    reasons,
    still_page,
)
from sim_action.reports.table import Row, Table
from sim_action.results.outcome import DisplayStatus, ExpectationOutcome, Outcome
from sim_action.results.results_json import RESULTS_FILE
from sim_action.results.shard_results import EarlierRun, read_run
from sim_action.results.weaker_checks import paired_expectations

HISTORY_FILE: Final = "history.html"
_GOOD: Final = ("passed", "warned")
_WIDTH, _HEIGHT, _EDGE = 600.0, 120.0, 10.0
_COMMIT_DIGITS: Final = 7


@dataclass(frozen=True, slots=True)
class Point:
    """An expectation in one run."""

    run: int  # the index of the run
    status: DisplayStatus
    value: float | None  # the margin, of a goal that was met the time left in s; None: nothing was measured
    shown: str  # the value as people read it
    message: str  # the sentence of the verdict, or the reason why there is none


@dataclass(slots=True)
class History:
    """An expectation of a scenario in all runs that have it, the oldest first; `is_stated`: the newest one has it."""

    scenario: str
    expectation: str
    points: list[Point]
    is_stated: bool = True

    @property
    def judged(self) -> tuple[Point, ...]:
        """The points of runs that were not skipped or cut off."""
        return tuple(point for point in self.points if point.status != "skipped")

    @property
    def broken(self) -> tuple[Point | None, Point] | None:
        """The last point that was good, if any, and the first of the bad ones since; None: it is not broken now."""
        bad: Point | None = None
        for point in reversed(self.judged if self.is_stated else ()):
            if point.status in _GOOD:
                return (point, bad) if bad is not None else None
            bad = point
        return (None, bad) if bad is not None else None


def read_runs(places: Sequence[str]) -> list[EarlierRun]:
    """Return runs by their start, from results files and folders of them; shards are joined. Raises UsageError."""
    names: list[str] = []
    for place in places:
        is_run = not Path(place).is_dir() or (Path(place) / RESULTS_FILE).is_file()
        below = [] if is_run else sorted(path for path in Path(place).iterdir() if path.is_dir())
        names += [place] if is_run else [str(path) for path in below if any(path.rglob(RESULTS_FILE))]
    if not names:
        raise UsageError(escaped_line(f"no {RESULTS_FILE} below {', '.join(places)}; name the folders of earlier runs"))
    runs = [read_run(name) for name in names]
    return sorted(runs, key=lambda run: (run.started_at.timestamp() if run.started_at else 0.0, run.name))


def histories(runs: Sequence[EarlierRun]) -> list[History]:
    """Return the expectations of all scenarios, the currently broken ones first; another limit is the same one."""
    scenarios: dict[tuple[str, str], _Scenario] = {}
    for number, run in enumerate(runs):
        for outcome in (candidate for candidate in run.outcomes if not candidate.is_sample):
            scenarios.setdefault((compared_name(outcome.file), outcome.name), _Scenario()).add(number, outcome)
    every = [history for scenario in scenarios.values() for history in scenario.histories]
    return sorted(every, key=lambda history: history.broken is None)


class _Scenario:
    """The histories of one scenario."""

    def __init__(self) -> None:
        self.histories: list[History] = []
        # The last outcome with expectations, and the history of each of them.
        self._last: Outcome | None = None
        self._stated: dict[int, History] = {}

    def add(self, run: int, outcome: Outcome) -> None:
        """Add a later outcome; without a verdict, it counts for each expectation of the last one that had some."""
        if not outcome.expectations:
            point = Point(run, outcome.display_status, None, "", "; ".join(outcome.reasons) or outcome.ending)
            self._stated = self._stated or {0: self._begun(outcome, "verdict")}
            for history in self._stated.values():
                history.points.append(point)
            return
        pairs = [] if self._last is None else paired_expectations(self._last, outcome)
        earlier = {id(now): self._stated[id(old)] for old, now in pairs}
        for history in self.histories:
            history.is_stated = False
        self._last, self._stated, seen = outcome, {}, Counter[str]()
        for expected in outcome.expectations:
            seen[expected.name] += 1
            name = expected.name if seen[expected.name] == 1 else f"{expected.name} ({seen[expected.name]})"
            history = self._stated[id(expected)] = earlier.get(id(expected)) or self._begun(outcome, name)
            history.expectation, history.is_stated = name, True
            value, unit = _value(expected)
            history.points.append(Point(run, expected.display_status, value, quantity(value, unit), expected.message))

    def _begun(self, outcome: Outcome, name: str) -> History:
        self.histories.append(History(outcome.name, name, []))
        return self.histories[-1]


def _value(expected: ExpectationOutcome) -> tuple[float | None, str]:
    verdict = expected.verdict
    if verdict.cut_off or verdict.status == "not_exercised":
        return None, ""
    if verdict.goal and verdict.status == "passed":
        end = None if expected.scope is None else expected.scope.end
        return (None if end is None or verdict.time is None else end - verdict.time), "s"
    # A goal that was missed has another unit than the time that is left to one that was met.
    return (None if verdict.goal else verdict.margin), verdict.unit


def write_history(runs: Sequence[EarlierRun], folder: Path) -> list[str]:
    """Write the page into an existing folder, and return a line for each expectation that is broken now."""
    every, labels = histories(runs), [_label(run) for run in runs]
    broken = [history for history in every if history.broken is not None]
    with whole_file(folder / HISTORY_FILE) as file:
        file.write(still_page("history", _body(every, labels), failed=bool(broken)))
    return [one_line(f"{history.scenario}: {history.expectation}: {_sentence(history, labels)}") for history in broken]


def _label(run: EarlierRun) -> str:
    name = run.commit[:_COMMIT_DIGITS] if run.commit else Path(run.name).name or run.name
    return f"{name} ({run.started_at:%Y-%m-%d})" if isinstance(run.started_at, datetime) else name


def _sentence(history: History, labels: Sequence[str]) -> str:
    if history.broken is None:
        return "not broken"
    (good, bad_point), last = history.broken, history.points[-1].run
    left = f"; not run since {labels[last]}" if last < len(labels) - 1 else ""
    if good is None:
        return f"never good since {labels[bad_point.run]}: {bad_point.message}{left}"
    before = f" (margin {good.shown})" if good.shown else ""
    return f"broken by {labels[bad_point.run]}: {bad_point.message}; good until {labels[good.run]}{before}{left}"


def _body(every: Sequence[History], labels: Sequence[str]) -> Html:
    broken = [history for history in every if history.broken is not None]
    kind = "failed" if broken else "passed"
    title = f"{len(broken)} of {counted(len(every), 'expectation')} broken" if broken else "Nothing is broken"
    head = page_header(title, kind, f"{counted(len(labels), 'run')}, {labels[0]} to {labels[-1]}")
    by_scenario: dict[str, list[History]] = {}
    for history in every:
        by_scenario.setdefault(history.scenario, []).append(history)
    articles = [_article(f"h{n}", name, listed, labels) for n, (name, listed) in enumerate(by_scenario.items())]
    return joined(head, element("main", *articles))


def _article(identity: str, name: str, listed: Sequence[History], labels: Sequence[str]) -> Html:
    broken = [history for history in listed if history.broken is not None]
    kind = "failed" if broken else "passed"
    sentences = [reason("", element("h3", history.expectation), _sentence(history, labels)) for history in broken]
    status = element("p", f"{len(broken)} broken" if broken else "Passed", class_=f"status {kind}")
    parts = joined(*(_chart(history, labels) for history in listed))
    if not broken:
        parts = element("details", element("summary", counted(len(listed), "expectation")), parts, class_="rest")
    return article(identity, kind, (status, heading(identity, name)), joined(reasons(sentences), parts))


def _chart(history: History, labels: Sequence[str]) -> Html:
    """Return the line of the margins, its bounds in words, and all values in a fold."""
    margins = [point.value for point in history.points if point.value is not None]
    low, high = min([0.0, *margins]), max([0.0, *margins])
    step = (_WIDTH - 2 * _EDGE) / max(1, len(labels) - 1)

    def place(point: Point) -> str:
        share = 0.0 if point.value is None or high == low else (point.value - low) / (high - low)
        return f"{_EDGE + step * point.run:.1f} {_HEIGHT - _EDGE - share * (_HEIGHT - 2 * _EDGE):.1f}"

    zero = _HEIGHT - _EDGE - (-low / (high - low) if high > low else 0.0) * (_HEIGHT - 2 * _EDGE)
    line = " L ".join(place(point) for point in history.points if point.value is not None)
    dots = [
        element(
            "path",
            element("title", f"{labels[point.run]}: {point.shown or point.status}"),
            d=f"M {place(point)} h 0.01",
            class_=f"dot {point.status}",
        )
        for point in history.points
    ]
    drawing = element(
        "svg",
        element("path", d=f"M 0 {zero:.1f} H {_WIDTH:.0f}", class_="zero"),
        element("path", d=f"M {line}", class_="way") if line else "",
        *dots,
        viewBox=f"0 0 {_WIDTH:.0f} {_HEIGHT:.0f}",
        preserveAspectRatio="none",
        role="img",
        aria_label=f"{history.expectation}: {_sentence(history, labels)}",
        class_="drawing history",
    )
    shown = [point.shown for point in history.points if point.shown]
    bad = sum(point.status not in _GOOD for point in history.judged)
    rate = f"good in {len(history.judged) - bad} of {counted(len(history.judged), 'run')}"
    between = f"margin {shown[0]} first, {shown[-1]} last; the dashed line is the limit" if shown else "no margin"
    caption = f"{rate}; {between}" if history.judged else "never judged"
    caption = caption if history.is_stated else f"no longer stated; {caption}"
    rows = tuple(
        Row(point.status, labels[point.run], point.message, (point.shown,)) for point in reversed(history.points)
    )
    values = html_table(Table("Run", rows, ("Margin",), message="Verdict"), None)
    fold = element("details", element("summary", "All values"), values)
    return joined(element("h3", history.expectation), element("div", drawing, class_="still"), faint(caption), fold)
