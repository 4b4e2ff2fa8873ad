"""The article of all scenarios: counts by status, and a table with a row for each scenario or gate, worst first."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Final

from sim_action.core.wording import counted, shortened
from sim_action.reports.html.alike import alike
from sim_action.reports.html.changes import ScenarioChange
from sim_action.reports.html.document import Html, element, joined
from sim_action.reports.html.navigation import PagePlan
from sim_action.reports.html.suite_rows import (
    duration_cell,
    group_name_cell,
    name_cell,
    nearest_cell,
    runs_table,
    sort_margin,
)
from sim_action.reports.scenario_groups import ScenarioGroup
from sim_action.reports.statuses import STATUS_DISPLAYS
from sim_action.results.outcome import WORST_FIRST, DisplayStatus, Outcome

if TYPE_CHECKING:
    from sim_action.reports.html.changes import ScenarioChangeKind
    from sim_action.reports.html.small_path import RunLook

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

    Args:
        plan: the articles of the page.
        looks: `id()` of an outcome -> what its replay shows.
        changes: `id()` of an outcome -> its change; empty: the table has no column for changes.
    """
    table = _SuiteTable(plan, looks, changes)
    return element(
        "article",
        element("header", element("h2", "All scenarios", id="suite-name")),
        joined(
            _status_counts(plan.groups),
            alike(plan.groups, plan.ids, looks, changes),
            table.drawn(),
            element("p", _LEGEND, class_="faint legend-of-bars"),
        ),
        id="suite",
        class_=f"scenario suite{' changed' if changes else ''}",
        aria_labelledby="suite-name",
    )


_LEGEND: Final = (
    "A bar of a margin shows it relative to its limit, at most 100 %: to the right, the expectation held; to the left, "
    "it failed. A bar of wall time is relative to the longest one. Paths are seen from above, each in a scale of its "
    "own, from the circle to the dot."
)


def _status_counts(groups: Iterable[ScenarioGroup]) -> Html:
    counts = Counter(status for group in groups for status in _judged(group))
    chips = [
        element(
            "li",
            element("span", STATUS_DISPLAYS[status].symbol, class_=f"mark {status}", aria_hidden="true"),
            f" {_count_text(status, counts[status])}",
            data_status=status,
        )
        for status in WORST_FIRST
        if counts[status]
    ]
    return element("ul", *chips, class_="chips", aria_label="Scenarios by status")


def _count_text(status: DisplayStatus, count: int) -> str:
    plural = "s" if count > 1 and status in ("error", "warned") else ""
    return f"{count} {STATUS_DISPLAYS[status].word}{plural}"


def _judged(group: ScenarioGroup) -> list[DisplayStatus]:
    if group.gate is not None or group.is_part:
        return [group.status]
    return [outcome.display_status for outcome in group.outcomes]


_MAX_CHANGE: Final = 120

_COLUMNS: Final = {
    "status": "",
    "name": "Scenario",
    "margin": "Nearest limit and its margin",
    "sim": "Sim time",
    "wall": "Wall time",
    "change": "Change",
    "path": "Path",
}
"""Key of a column -> its title; the key is also the word for its order in an address."""


class _SuiteTable:
    """The table with a body for each group."""

    def __init__(self, plan: PagePlan, looks: Mapping[int, RunLook], changes: Mapping[int, ScenarioChange]) -> None:
        self._plan, self._changes = plan, changes
        self._paths = {number: look.path for number, look in looks.items()}
        self._places = {id(entry.group): entry.identity for entry in plan.entries if entry.group is not None}
        self._longest = max((_wall_time(group) for group in plan.groups), default=0.0)

    def drawn(self) -> Html:
        """Return the table."""
        columns = {key: title for key, title in _COLUMNS.items() if key != "change" or self._changes}
        heads = [
            element("th", title, scope="col", data_sort=None if key == "path" else key)
            if title
            else element("td", data_sort=key)
            for key, title in columns.items()
        ]
        return element(
            "table",
            element("thead", element("tr", *heads)),
            joined(*map(self._body, self._plan.groups)),
            class_="suite-table",
        )

    def _body(self, group: ScenarioGroup) -> Html:
        """Return the rows of a group; empty if the page has no article of it."""
        place = self._places.get(id(group), "")
        runs = [outcome for outcome in group.worst_first() if id(outcome) in self._plan.ids]
        if not runs and not place:
            return Html("")
        # A gate that was refused has no run.
        shown = runs[0] if runs else group.worst if group.outcomes else group.gate
        assert shown is not None
        judged = [group.gate] if group.gate is not None else runs
        found = [self._changes[id(each)] for each in judged if id(each) in self._changes]
        change = min(found, key=_change_rank, default=None)
        status = None if group.varies and group.gate is None and not group.is_part else group.status
        return element(
            "tbody",
            self._row(group, shown, place, change),
            self._fold(group, runs) if group.varies and runs else "",
            data_status=status,
            data_margin=sort_margin(shown),
            data_sim=_rounded(_sim_time(group)),
            data_wall=_rounded(_wall_time(group)),
            data_change=None if change is None else str(_change_rank(change)),
            data_file=shown.file or None,
            data_tags=" ".join(shown.tags) or None,
        )

    def _row(self, group: ScenarioGroup, shown: Outcome, place: str, change: ScenarioChange | None) -> Html:
        if group.varies:
            name = group_name_cell(group, place or self._plan.ids[id(shown)])
            nearest = element("td", element("span", group.ending, class_="what"), class_="nearest")
            nearest = nearest if group.gate is not None or group.is_part else nearest_cell(shown)
        else:
            name, nearest = name_cell(shown, self._plan.ids[id(shown)]), nearest_cell(shown)
        changed = "" if change is None else shortened(change.gist, _MAX_CHANGE)
        display = group.display
        return element(
            "tr",
            element(
                "td",
                element("span", display.symbol, class_=f"mark {group.status}", role="img", aria_label=display.word),
            ),
            name,
            nearest,
            duration_cell("Sim time", _sim_time(group)),
            duration_cell("Wall time", _wall_time(group), self._longest),
            element("td", changed, class_="change", data_title="Change") if self._changes else "",
            element("td", self._paths.get(id(shown), ""), class_="path"),
        )

    def _fold(self, group: ScenarioGroup, runs: list[Outcome]) -> Html:
        words = counted(len(group.outcomes), "variation" if group.gate is None and not group.is_part else "run")
        table = runs_table(group, runs, self._plan.ids, self._paths)
        fold = element("details", element("summary", words), table)
        return element("tr", element("td", fold, colspan=7 if self._changes else 6), class_="fold")


def _change_rank(change: ScenarioChange) -> int:
    return _CHANGES.index(change.kind)


def _sim_time(group: ScenarioGroup) -> float:
    return sum(outcome.simulated for outcome in group.outcomes)


def _wall_time(group: ScenarioGroup) -> float:
    return sum(outcome.wall_time for outcome in group.outcomes)


def _rounded(value: float) -> str | None:
    return f"{value:.4g}" if value else None
