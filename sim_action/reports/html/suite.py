"""The article of all scenarios: counts by status, failures that look alike, and a table with the worst rows first."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import isfinite
from typing import TYPE_CHECKING, Final, TypeAlias

from sim_action.core.wording import counted, shortened
from sim_action.reports.display import STATUS_DISPLAYS
from sim_action.reports.escaping import one_line
from sim_action.reports.formatting import moment, quantity
from sim_action.reports.html.document import (
    Html,
    article,
    bullets,
    element,
    heading,
    html_row,
    joined,
    status_mark,
    table,
    titled,
)
from sim_action.reports.html.gate_article import parameters, run_row
from sim_action.reports.html.navigation import PagePlan
from sim_action.reports.html.scenario_article import first_seen_words
from sim_action.reports.scenario_groups import ScenarioGroup, nearest_expectation, relative_margin
from sim_action.reports.table import Table
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
            f" {_count_text(status, counts[status])}",
            data_status=status,
        )
        for status in WORST_FIRST
        if counts[status]
    ]
    body = joined(
        element("ul", *chips, class_="chips", aria_label="Scenarios by status"),
        alike(plan.groups, plan.ids, looks, changes),
        _SuiteTable(plan, looks, changes).drawn(),
        element("p", _LEGEND, class_="faint legend-of-bars"),
    )
    return article("suite", f"suite{' changed' if changes else ''}", [heading("suite", "All scenarios")], body)


_LEGEND: Final = (
    "A bar of a margin shows it relative to its limit, at most 100 %: to the right, the expectation held; to the left, "
    "it failed. A bar of wall time is relative to the longest one. Paths are seen from above, each in a scale of its "
    "own, from the circle to the dot."
)


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
        changes = [self._changes[id(run)] for run in judged if id(run) in self._changes]
        change = min(changes, key=_change_rank, default=None)
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
            name = name_cell(shown, self._plan.ids[id(shown)])
            nearest = nearest_cell(shown)
        changed = "" if change is None else shortened(change.gist, _MAX_CHANGE)
        return element(
            "tr",
            element("td", status_mark(group.row_status)),
            name,
            nearest,
            duration_cell("Sim time", _sim_time(group)),
            duration_cell("Wall time", _wall_time(group), self._longest),
            element("td", changed, class_="change", data_title="Change") if self._changes else "",
            element("td", self._paths.get(id(shown), ""), class_="path"),
        )

    def _fold(self, group: ScenarioGroup, runs: list[Outcome]) -> Html:
        words = counted(len(group.outcomes), "variation" if group.gate is None and not group.is_part else "run")
        fold = element("details", element("summary", words), runs_table(group, runs, self._plan.ids, self._paths))
        return element("tr", element("td", fold, colspan=7 if self._changes else 6), class_="fold")


def _change_rank(change: ScenarioChange) -> int:
    return _CHANGES.index(change.kind)


def _sim_time(group: ScenarioGroup) -> float:
    return sum(outcome.simulated for outcome in group.outcomes)


def _wall_time(group: ScenarioGroup) -> float:
    return sum(outcome.wall_time for outcome in group.outcomes)


def _rounded(value: float) -> str | None:
    return f"{value:.4g}" if value else None


_MAX_TEXT: Final = 300
_HALF: Final = 50  # half of the width of a bar of a margin, which is 100 % of the limit
_LEAST_BAR: Final = 1.5
_NO_VERDICT: Final = -2.0  # the margin by which runs without a verdict are sorted: before failed runs


def name_cell(outcome: Outcome, identity: str) -> Html:
    """Return the name of a scenario, linked to its article, and its file."""
    link = element("a", one_line(outcome.name), href=f"#{identity}")
    return element("th", link, _small(outcome.file), scope="row")


def group_name_cell(group: ScenarioGroup, identity: str) -> Html:
    """Return the name of a gate or varied scenario with counts and file; `identity`: its article's, or worst run's."""
    name = one_line(group.gate.name if group.gate is not None else group.name)
    link = element("a", name, href=f"#{identity}")
    file = (group.gate or group.outcomes[0]).file
    counts = group.rate_text and f"gate: {group.rate_text}"
    summary = counts or (group.gate_text if group.is_part or group.gate is not None else group.passed)
    return element("th", link, _small(f"{summary} · {file}" if file else summary), scope="row")


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
    shown = Table("Run", (), tuple(column.label for column in columns))
    titles = (*shown.titles, "Nearest limit", "Sim time", "Wall time", "Path")
    rows = (
        html_row(
            shown,
            run_row(run, numbers[id(run)], columns, ids[id(run)]),
            None,
            nearest_cell(run),
            duration_cell("Sim time", run.simulated),
            duration_cell("Wall time", run.wall_time, longest),
            element("td", paths.get(id(run), ""), class_="path"),
        )
        for run in runs
    )
    return table(titles, joined(*rows), around="wide runs")


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
        if group.gate is not None or group.is_part:
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
