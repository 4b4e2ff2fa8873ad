"""The plan of the page: which articles it has, how addresses name them, and the list of them on the left."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain, count
from typing import Final, Literal

from sim_action.core.records import dataclass
from sim_action.core.wording import counted
from sim_action.reports.escaping import one_line
from sim_action.reports.formatting import first_message
from sim_action.reports.html.document import Html, element, joined, status_mark
from sim_action.reports.scenario_groups import ScenarioGroup, worst_first
from sim_action.results.artifacts import namesake_number
from sim_action.results.outcome import WORST_FIRST, DisplayStatus, Outcome
from sim_action.results.results_json import Results

EntryKind = Literal["scenario", "sample", "gate", "variations"]
"""The kind of an article: a run that counts, a run of a gate, a gate, or all variations of a scenario together."""


@dataclass(frozen=True, slots=True)
class PageEntry:
    """An article of the page."""

    identity: str  # its element id
    kind: EntryKind
    name: str  # name, number: the name in addresses, and the number among the articles of this name, from 1
    number: int
    status: DisplayStatus
    outcome: Outcome | None  # the run or the gate; None for the variations of a scenario
    group: ScenarioGroup | None  # the runs of a gate or of a scenario; None for a run


@dataclass(frozen=True, slots=True)
class PagePlan:
    """The articles of a page in their order."""

    groups: Sequence[ScenarioGroup]  # all groups, the worst first
    entries: Sequence[PageEntry]
    runs: Sequence[Outcome]  # the runs with an article, in the order in which they get a place for their replay
    ids: Mapping[int, str]  # `id()` of an outcome -> the element id of its article
    gates: Mapping[tuple[str, str | None], str]  # file and name of a gate -> the element id of its article
    left: int  # the number of runs without an article

    @property
    def has_suite(self) -> bool:
        """Return True if the page has several scenarios or gates, and so an article of all of them."""
        return len(self.groups) > 1


def planned_page(unordered: Sequence[ScenarioGroup], most: int) -> PagePlan:
    """Return the plan of a page with at most `most` runs: the worst ones, and runs that count by themselves first."""
    groups = worst_first(unordered)
    everything = [outcome for group in groups for outcome in group.worst_first()]
    runs = sorted(everything, key=lambda run: (WORST_FIRST.index(run.display_status), run.is_sample))[:most]
    kept = {id(run) for run in runs}
    planned = [entry for group in groups for entry in _planned_entries(group, kept)]
    numbers = _numbers([(_name(outcome, group), _replay(outcome)) for _, outcome, group in planned])
    entries = [
        PageEntry(
            identity=f"s{place}",
            kind=kind,
            name=one_line(_name(outcome, group)),
            number=number,
            status=group.status if outcome is None else outcome.display_status,
            outcome=outcome,
            group=None if kind in ("scenario", "sample") else group,
        )
        for place, ((kind, outcome, group), number) in enumerate(zip(planned, numbers, strict=True))
    ]
    return PagePlan(
        groups=groups,
        entries=entries,
        runs=runs,
        ids={id(entry.outcome): entry.identity for entry in entries if entry.outcome is not None},
        gates={
            (entry.outcome.file, entry.outcome.gate): entry.identity
            for entry in entries
            if entry.kind == "gate" and entry.outcome is not None
        },
        left=len(everything) - len(runs),
    )


_Planned = tuple[EntryKind, Outcome | None, ScenarioGroup]


def _planned_entries(group: ScenarioGroup, kept: set[int]) -> Iterator[_Planned]:
    if group.gate is not None:
        yield "gate", group.gate, group
    elif len(group.outcomes) > 1:
        from sim_action.reports.html.gate_article import has_plot  # most scenarios have one run

        if has_plot(group.outcomes):
            yield "variations", None, group
    for run in group.worst_first():
        if id(run) in kept:
            yield "sample" if run.is_sample else "scenario", run, group


def _name(outcome: Outcome | None, group: ScenarioGroup) -> str:
    return group.name if outcome is None else outcome.name


def _replay(outcome: Outcome | None) -> str:
    return "" if outcome is None else outcome.replay or ""


def _numbers(named: Sequence[tuple[str, str]]) -> list[int]:
    """Return the number of each article among articles of its name, equal to the number in links to its replay."""
    taken: defaultdict[str, set[int]] = defaultdict(set)
    # The next number to try for a name, so that many equal names do not take quadratic time.
    free: defaultdict[str, Iterator[int]] = defaultdict(lambda: count(1))
    numbers = [0] * len(named)
    for place, (name, replay) in sorted(enumerate(named), key=lambda entry: not entry[1][1]):
        stated = namesake_number(name, replay)
        shown = one_line(name)
        number = next(number for number in chain([stated], free[shown]) if number not in taken[shown])
        taken[shown].add(number)
        numbers[place] = number
    return numbers


def scenario_list(plan: PagePlan, results: Results) -> Html:
    """Return the list of scenarios; empty for a single one."""
    shown = len(plan.runs)
    if shown + plan.left < 2:
        return Html("")
    noun = "more run" if results.gates else "more scenario"
    more = element(
        "p", f"{counted(plan.left, noun)} in results.json; this page shows the worst {shown}.", class_="faint none"
    )
    places = {id(entry.group): entry.identity for entry in plan.entries if entry.group is not None}
    gates = sum(outcome.statistics is not None for outcome in results.verdicts)
    counts = ((results.total - gates, "scenario"), (gates, "gate"))
    return element(
        "nav",
        element("a", "Skip to the content", href="#main", class_="skip") if plan.has_suite else "",
        element("a", "All scenarios", href="#suite", class_="all") if plan.has_suite else "",
        element(
            "details",
            element("summary", ", ".join(counted(number, noun) for number, noun in counts if number)),
            element("ol", *(_list_entry(group, places.get(id(group), ""), plan.ids) for group in plan.groups)),
            more if plan.left else "",
            open=True,
        ),
        aria_label="Scenarios",
        class_="scenarios",
    )


_MAX_IN_GIST: Final = 300


def _list_entry(group: ScenarioGroup, place: str, ids: Mapping[int, str]) -> Html:
    listed = [outcome for outcome in group.worst_first() if id(outcome) in ids]
    if not listed and not place:
        return Html("")
    if not group.varies:
        return _list_item(listed[0], listed[0].name, ids)
    items = [_list_item(outcome, group.values(outcome), ids) for outcome in listed]
    if group.gate is not None:
        runs = element("summary", counted(len(group.outcomes), "run"), class_="faint")
        fold = element("details", runs, element("ol", *items)) if items else ""
        link = list_link(place, status_mark(group.gate.display_status), group.gate.name, f"gate: {group.rate_text}")
        return element("li", link, fold, class_="group gate")
    title = joined(
        status_mark(group.status),
        element("span", one_line(group.name), element("small", _count_text(group), class_="faint"), class_="name"),
    )
    if place:
        together = element(
            "span", f"All {counted(len(group.outcomes), 'run' if group.is_part else 'variation')}", class_="name"
        )
        items.insert(0, element("li", element("a", element("span", class_="mark"), together, href=f"#{place}")))
    is_open = group.status != "passed" and not group.is_part
    fold = element("details", element("summary", title), element("ol", *items), open=is_open)
    return element("li", fold, class_="group")


def _count_text(group: ScenarioGroup) -> str:
    return group.gate_text if group.is_part else group.passed


def _list_item(outcome: Outcome, name: str, ids: Mapping[int, str]) -> Html:
    mark = status_mark(outcome.display_status, neutral=outcome.is_sample)
    return element("li", list_link(ids[id(outcome)], mark, name, first_message(outcome, _MAX_IN_GIST)))


def list_link(identity: str, mark: Html, name: str, words: str) -> Html:
    """Return an entry of the list that leads to an article: its mark, its name, and words about it."""
    gist = element("small", words, class_="faint") if words else ""
    return element("a", mark, element("span", one_line(name), gist, class_="name"), href=f"#{identity}")
