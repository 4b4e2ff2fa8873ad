"""The article of all scenarios: counts by status, failures that look alike, and a table with the worst rows first."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import isfinite
from typing import TYPE_CHECKING, Final, TypeAlias

from sim_action.core.wording import counted, shortened
from sim_action.reports.display import STATUS_DISPLAYS
from sim_action.reports.escaping import one_line
from sim_action.reports.formatting import moment
from sim_action.reports.html.document import Html, article, bullets, element, heading, html_table, joined, titled
from sim_action.reports.html.gate_article import nearest_limit, runs_table
from sim_action.reports.html.navigation import PagePlan
from sim_action.reports.html.scenario_article import first_seen_words
from sim_action.reports.scenario_groups import ScenarioGroup, nearest_expectation, relative_margin
from sim_action.reports.table import Bar, Row, Table, Value
from sim_action.results.outcome import WORST_FIRST, DisplayStatus, ExpectationOutcome, Outcome
from sim_action.state.verdict import Verdict

if TYPE_CHECKING:
    from sim_action.reports.html.base_run import ScenarioChange, ScenarioChangeKind
    from sim_action.reports.html.top_view import RunLook

_CHANGES: Final[tuple[ScenarioChangeKind, ...]] = (
    "newly fails",
    "flaky",
    "fails differently",
    "removed",
    "not run",
    "not repeated",
    "weaker",
    "less margin",
    "slower",
    "fixed",
    "new",
    "moves differently",
    "still fails",
    "still passes",
    "unchanged",
)
"""The kinds of changes, the most important first."""


def suite_article(plan: PagePlan, looks: Mapping[int, RunLook], changes: Mapping[int, ScenarioChange]) -> Html:
    """Return the article of all scenarios.

    `plan`: the articles of the page; `looks`: `id()` of an outcome -> what its replay shows; `changes`: `id()` of an
    outcome -> its change; empty: the table has no column for changes.
    """
    counts = Counter(status for group in plan.groups for status in _judged(group))
    chips = [
        element(
            "li",
            element("span", STATUS_DISPLAYS[status].symbol, class_=f"mark {status}", aria_hidden="true"),
            f" {STATUS_DISPLAYS[status].counted(counts[status])}",
            data_status=status,
        )
        for status in WORST_FIRST
        if counts[status]
    ]
    body = joined(
        element("ul", *chips, class_="chips", aria_label="Scenarios by status"),
        alike(plan.groups, plan.ids, looks, changes),
        html_table(_Suite(plan, looks, changes).table(), None, around="suite-table"),
        element("p", _LEGEND, class_="faint legend-of-bars"),
    )
    return article("suite", f"suite{' changed' if changes else ''}", [heading("suite", "All scenarios")], body)


_LEGEND: Final = (
    "A bar of a margin shows it relative to its limit, at most 100 %: to the right, the expectation held; to the left, "
    "it failed. A bar of wall time is relative to the longest one. Paths are seen from above, each in a scale of its "
    "own, from the circle to the dot."
)


def _judged(group: ScenarioGroup) -> list[DisplayStatus]:
    if group.is_gate:
        return [group.status]
    return [outcome.display_status for outcome in group.outcomes]


_MAX_CHANGE: Final = 120
_MAX_MESSAGE: Final = 300
_NO_VERDICT: Final = -2.0  # the margin by which runs without a verdict are sorted: before failed runs
_ORDERS: Final = {"Scenario": "name", "Margin": "margin", "Sim time": "sim", "Wall time": "wall", "Change": "change"}
"""Title of a column -> the order of the rows by it, as addresses name it."""


class _Suite:
    """The table of all groups, with the runs of each one below it."""

    def __init__(self, plan: PagePlan, looks: Mapping[int, RunLook], changes: Mapping[int, ScenarioChange]) -> None:
        self._plan, self._looks, self._changes = plan, looks, changes
        self._places = {id(entry.group): entry.identity for entry in plan.entries if entry.group is not None}

    def table(self) -> Table:
        """Return the table of the groups that have an article."""
        columns = ("Margin", "Sim time", "Wall time", *(("Change",) if self._changes else ()), "Path")
        longest = max((_wall_time(group.outcomes) for group in self._plan.groups), default=0.0)
        rows = (row for group in self._plan.groups if (row := self._row(group, longest)) is not None)
        return Table("Scenario", tuple(rows), columns, message="Nearest limit", orders=_ORDERS)

    def _row(self, group: ScenarioGroup, longest: float) -> Row | None:
        place = self._places.get(id(group), "")
        runs = [run for run in group.worst_first() if id(run) in self._plan.ids]
        if not runs and not place:
            return None
        # A gate that was refused has no run.
        shown = runs[0] if runs else group.worst if group.outcomes else group.gate
        assert shown is not None
        judged = [group.gate] if group.gate is not None else runs
        changes = [self._changes[id(run)] for run in judged if id(run) in self._changes]
        change = min(changes, key=_change_rank, default=None)
        ending = (shortened(one_line(group.ending), _MAX_MESSAGE), "")
        message, margin = ending if group.is_gate else nearest_limit(shown)
        counts = group.gate_text if group.is_gate else group.passed
        notes = (
            f"gate: {group.rate_text}" if group.rate_text else counts if group.varies else "",
            one_line(shown.file),
        )
        changed = ("" if change is None else shortened(change.gist, _MAX_CHANGE),) if self._changes else ()
        return Row(
            group.row_status,
            one_line(group.name if group.gate is None else group.gate.name),
            message,
            (margin, *_durations(group.outcomes, longest), *changed, self._path(shown)),
            notes=tuple(filter(None, notes)),
            link=place or self._plan.ids[id(shown)],
            below=self._runs(group) if group.varies and runs else None,
            data={
                "status": None if group.varies and not group.is_gate else group.status,
                "margin": sort_margin(shown),
                "sim": _rounded(_sim_time(group.outcomes)),
                "wall": _rounded(_wall_time(group.outcomes)),
                "change": None if change is None else str(_change_rank(change)),
                "file": shown.file or None,
                "tags": " ".join(shown.tags) or None,
            },
        )

    def _runs(self, group: ScenarioGroup) -> Table:
        longest = max(run.wall_time for run in group.outcomes)
        titles = ("Sim time", "Wall time", "Path")
        return runs_table(group, self._plan.ids, titles, lambda run: (*_durations([run], longest), self._path(run)))

    def _path(self, run: Outcome) -> str:
        look = self._looks.get(id(run))
        return "" if look is None else look.path


def _change_rank(change: ScenarioChange) -> int:
    return _CHANGES.index(change.kind)


def _durations(runs: Iterable[Outcome], longest: float) -> tuple[Value, Value]:
    """Return sim time and wall time of runs, with a bar relative to the longest wall time; nothing for 0 s."""
    wall = _wall_time(runs)
    return _seconds(_sim_time(runs)), Bar(_seconds(wall), wall / longest) if wall else ""


def _seconds(time: float) -> str:
    return "" if not time else f"{time:.1f} s" if time < 100 else f"{time:.0f} s"


def _sim_time(runs: Iterable[Outcome]) -> float:
    return sum(run.simulated for run in runs)


def _wall_time(runs: Iterable[Outcome]) -> float:
    return sum(run.wall_time for run in runs)


def _rounded(value: float) -> str | None:
    return f"{value:.4g}" if value else None


def sort_margin(outcome: Outcome) -> str | None:
    """Return the relative margin as text to sort by; None if nothing was measured."""
    expected = nearest_expectation(outcome)
    if expected is None:
        return None if outcome.status in ("passed", "skipped") else f"{_NO_VERDICT:g}"
    if expected.verdict.status == "passed" and expected.verdict.goal:
        return None
    relative = relative_margin(expected)
    return f"{relative:.4g}" if isfinite(relative) else None


_Failed: TypeAlias = tuple[Outcome, ExpectationOutcome]  # a failed run, and the expectation that failed first
_MAX_KINDS: Final = 8
_MAX_NAMES: Final = 12


def alike(
    groups: Iterable[ScenarioGroup],
    ids: Mapping[int, str],
    looks: Mapping[int, RunLook],
    changes: Mapping[int, ScenarioChange],
) -> Html:
    """Return the list of failures that several scenarios share, the most frequent first; empty without any.

    Args:
        groups: the scenarios.
        ids: `id()` of an outcome -> the element id of its article.
        looks: `id()` of an outcome -> what its replay shows.
        changes: `id()` of an outcome -> its change since an earlier run.
    """
    kinds: dict[tuple[str, str], list[_Failed]] = {}
    for outcome, expected in _failures(groups):
        body = expected.verdict.body
        kinds.setdefault((body, "" if body else expected.name), []).append((outcome, expected))
    # Variations of one scenario stand together in the table.
    several = [failures for failures in kinds.values() if len(_scenarios(failures)) > 1]
    several.sort(key=len, reverse=True)
    items = [_item(failures, ids, looks, _shared(failures, changes)) for failures in several[:_MAX_KINDS]]
    return titled("Failures that look alike", bullets(items, "alike"))


def _failures(groups: Iterable[ScenarioGroup]) -> Iterator[_Failed]:
    """Yield each failed run that counts by itself, with the expectation that failed first."""
    for group in groups:
        if group.is_gate:
            continue
        for outcome in group.outcomes:
            failed = [expected for expected in outcome.expectations if expected.failed and not expected.verdict.cut_off]
            if failed:
                yield outcome, min(failed, key=_time)


def _scenarios(failures: Iterable[_Failed]) -> set[tuple[str, str]]:
    return {(outcome.file, outcome.group or outcome.name) for outcome, _ in failures}


def _time(expected: ExpectationOutcome) -> float:
    time = expected.verdict.time
    return float("inf") if time is None else time


def _kind(failures: Iterable[_Failed]) -> str:
    """Return the words for failures of one kind, such as "touched pallet, or came too near"."""
    expected = [expectation for _, expectation in failures]
    if not (body := expected[0].verdict.body):
        return f"failed {expected[0].name}"
    near = [_is_apart(expectation.verdict) for expectation in expected]
    if all(near):
        return f"came too near to {body}"
    return f"touched {body}{', or came too near' if any(near) else ''}"


def _is_apart(verdict: Verdict) -> bool:
    return verdict.unit == "m" and verdict.measured is not None and verdict.measured > 0.0


def _shared(failures: Sequence[_Failed], changes: Mapping[int, ScenarioChange]) -> str:
    worlds = {change.world if (change := changes.get(id(outcome))) else "" for outcome, _ in failures}
    return worlds.pop() if len(worlds) == 1 else ""


def _item(failures: Sequence[_Failed], ids: Mapping[int, str], looks: Mapping[int, RunLook], shared: str) -> Html:
    noun = "scenario" if len(_scenarios(failures)) == len(failures) else "run"
    parts: list[str] = [element("b", f"{counted(len(failures), noun)} {one_line(_kind(failures))}")]
    parts += [". Since the base run, ", element("b", shared), ": "] if shared else [": "]
    for number, (outcome, expected) in enumerate(failures[:_MAX_NAMES]):
        name, time = one_line(outcome.name), expected.verdict.time
        place = ids.get(id(outcome))
        parts += ["; " if number else "", name if place is None else element("a", name, href=f"#{place}")]
        parts += [] if time is None else [f" at {moment(time)}"]
        # Without a body, the words name the expectation.
        if body := expected.verdict.body:
            seen = look.seen.get(body) if (look := looks.get(id(outcome))) else None
            parts.append(f" ({one_line(expected.assertion)}{'' if seen is None else f', {first_seen_words(seen)}'})")
    more = len(failures) - _MAX_NAMES
    return element("li", *parts, f" and {more} more" if more > 0 else "")
