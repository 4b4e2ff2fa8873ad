"""The report of `sim-action prove`: the findings, and each mutant that survived, next to the run without a fault."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from sim_action.core.errors import Location
from sim_action.core.files import whole_file
from sim_action.core.records import dataclass
from sim_action.core.wording import counted
from sim_action.recording.replay.replay_data import Replay, ReplayReader
from sim_action.reports import ReportOptions
from sim_action.reports.escaping import one_line
from sim_action.reports.formatting import simulated_text
from sim_action.reports.html.document import (
    Html,
    Page,
    ReplayBlocks,
    article,
    element,
    encoded,
    faint,
    heading,
    html_table,
    joined,
    page_header,
    page_json,
    reason,
    reasons,
    replay_id,
    source,
    status_mark,
    stored_replay,
    titled,
    values,
)
from sim_action.reports.html.ghosts import Ghost, ghost
from sim_action.reports.html.navigation import PageEntry, list_link
from sim_action.reports.html.report import index_entry
from sim_action.reports.html.scenario_article import drawn
from sim_action.reports.html.top_view import SceneOutlines
from sim_action.reports.proof import (
    by_suggestion,
    expectation_table,
    headline,
    other_mutants,
    suggestion_title,
    survivor_text,
)
from sim_action.results.artifacts import REPORT_FILE
from sim_action.results.outcome import DisplayStatus, Outcome
from sim_action.results.proof import MutantResult, Proof, ProvenScenario

MAX_SCENARIOS: Final = 500  # the number of scenarios on a page, those with remarks first; further ones are only counted


@dataclass(frozen=True, slots=True)
class ShownScenario:
    """A scenario of a proof with its runs; their replays are named from the folder of the page."""

    scenario: ProvenScenario
    original: Outcome | None = None  # the run without a mutant; None if there was none that passed
    survivors: Sequence[Outcome] = ()  # the outcomes of `scenario.survivors`

    @property
    def kind(self) -> DisplayStatus:
        """The kind of the findings, for colours and the order."""
        if self.scenario.useless:
            return "failed"
        is_open = not self.scenario.is_proven or any(
            expectation.finding == "unknown" for expectation in self.scenario.expectations
        )
        return "inconclusive" if is_open or self.scenario.survivors else "passed"


_ORDER: Final[tuple[DisplayStatus, ...]] = ("failed", "inconclusive", "passed")


@dataclass(frozen=True, slots=True)
class _Runs:
    """The entries of a scenario on the page: one for the scenario, and one for each survivor."""

    shown: ShownScenario
    entry: PageEntry
    survivors: Sequence[PageEntry]


def write_proof_page(proof: Proof, shown: Sequence[ShownScenario], options: ReportOptions, replays: Path) -> None:
    """Write `report.html` into the output folder; `replays`: the folder from which outcomes name replays."""
    with whole_file(options.folder / REPORT_FILE) as file:
        file.writelines(proof_page(proof, shown, options, replays).parts())


def proof_page(proof: Proof, shown: Sequence[ShownScenario], options: ReportOptions, replays: Path) -> Page:
    """Return the page: a list, an article for each scenario, and one for each survivor."""
    ordered = sorted(shown, key=lambda scenario: _ORDER.index(scenario.kind))
    every = [*_entries(ordered[:MAX_SCENARIOS])]
    drawer = _Drawer(replays)
    body = [_head(proof), f'<div class="layout">{_list(every, len(ordered))}<main>']
    index = []
    for runs in every:
        original, still = drawer.drawn(runs.entry)
        body.append(_scenario_article(runs, still, options))
        index.append(index_entry(runs.entry, drawer.blocks, ()))
        for entry, result in zip(runs.survivors, runs.shown.scenario.survivors, strict=True):
            faulty, still = drawer.drawn(entry)
            body.append(_survivor_article(entry, result, runs.entry, still))
            ghosts: tuple[Ghost, ...] = ()
            if original is not None and faulty is not None:
                name = replay_id(runs.entry.identity)
                ghosts = (ghost("the run without the fault", name, faulty, original, is_shown=True),)
            index.append(index_entry(entry, drawer.blocks, (), ghosts))
    body.append("</main></div>")
    return Page(
        f"{headline(proof)} · sim-action",
        bool(proof.useless),
        [encoded("\n".join(body))],
        page_json({"scenarios": index}),
        drawer.blocks.carried,
        has_replays=bool(drawer.blocks.blocks),
    )


def _entries(shown: Sequence[ShownScenario]) -> Iterator[_Runs]:
    """Yield the entries of each scenario, numbered through the page."""
    places = iter(range(1 << 30))
    names = Counter[str]()

    def entry(name: str, kind: DisplayStatus, outcome: Outcome | None, *, survives: bool) -> PageEntry:
        names[one_line(name)] += 1
        return PageEntry(
            identity=f"s{next(places)}",
            kind="sample" if survives else "scenario",
            name=one_line(name),
            number=names[one_line(name)],
            status=kind,
            outcome=outcome,
            group=None,
        )

    for shown_scenario in shown:
        own = entry(shown_scenario.scenario.name, shown_scenario.kind, shown_scenario.original, survives=False)
        yield _Runs(
            shown_scenario, own, [entry(run.name, "passed", run, survives=True) for run in shown_scenario.survivors]
        )


class _Drawer:
    """Reads replays, keeps as many as fit into the page, and draws them for readers without scripts."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._reader, self._outlines = folder, ReplayReader(), SceneOutlines()
        self.blocks = ReplayBlocks()

    def drawn(self, entry: PageEntry) -> tuple[Replay | None, Html]:
        """Return the replay and the drawing of a run; None and an empty drawing if there is none."""
        if entry.outcome is None:
            return None, Html("")
        replay, missing = stored_replay(entry.outcome, self._folder, self._reader)
        if replay is None:
            return None, element("p", missing, class_="faint") if missing else Html("")
        self.blocks.add(replay_id(entry.identity), replay)
        return replay, drawn(replay, entry.outcome, self._outlines)


def _head(proof: Proof) -> Html:
    is_open = proof.survivors or proof.interrupted or not proof.all_notice
    kind = "failed" if proof.useless else "inconclusive" if is_open else "passed"
    summary = f"{counted(proof.runs, 'run')} in {proof.wall_time:.1f} s · sim-action {proof.sim_action}"
    return page_header(headline(proof), kind, summary)


def _list(every: Sequence[_Runs], total: int) -> Html:
    """Return the list of scenarios, each with its survivors; empty if it would have a single entry."""
    if sum(1 + len(runs.survivors) for runs in every) < 2:
        return Html("")
    left = total - len(every)
    more = element("p", f"{counted(left, 'more scenario')} not shown.", class_="faint none") if left else ""
    title = element("summary", counted(total, "scenario"))
    items = element("ol", *map(_list_item, every))
    return element("nav", element("details", title, items, more, open=True), aria_label="Scenarios", class_="scenarios")


def _list_item(runs: _Runs) -> Html:
    entry = runs.entry
    link = list_link(entry.identity, status_mark(entry.status), entry.name, _status_text(runs.shown))
    if not runs.survivors:
        return element("li", link)
    mark = element("span", "!", class_="mark")
    items = []
    for entry, mutant in zip(runs.survivors, runs.shown.scenario.survivors, strict=True):
        change = mutant.change.text if mutant.change else ""
        items.append(element("li", list_link(entry.identity, mark, mutant.name, change)))
    return element("li", link, element("ol", *items))


def _status_text(shown: ShownScenario) -> str:
    """Return the findings on a scenario in a few words."""
    scenario = shown.scenario
    if not scenario.is_proven:
        return "not mutated"
    parts = [f"{len(scenario.useless)} of {counted(len(scenario.expectations), 'expectation')} checks nothing"]
    parts = parts if scenario.useless else []
    parts += [f"{counted(len(scenario.survivors), 'other motion')} unnoticed"] if scenario.survivors else []
    parts += [f"{counted(scenario.unfinished, 'mutant')} unfinished"] if scenario.unfinished else []
    return ", ".join(parts) or ("every expectation notices something" if shown.kind == "passed" else "nothing is known")


def _scenario_article(runs: _Runs, still: Html, options: ReportOptions) -> Html:
    scenario, entry = runs.shown.scenario, runs.entry
    links = {
        result.name: survivor_entry for survivor_entry, result in zip(runs.survivors, scenario.survivors, strict=True)
    }
    words = _status_text(runs.shown)
    place = source(Location(scenario.file, scenario.line), options) if scenario.file else ""
    header = (
        element("p", f"{words[0].upper()}{words[1:]}", class_=f"status {entry.status}"),
        heading(entry.identity, entry.name),
        element("p", place, class_="faint"),
    )
    body = joined(
        _reasons(scenario, links, options),
        titled("Expectations", html_table(expectation_table(scenario), options)),
        titled("Mutants", values(other_mutants(scenario), "facts")),
        titled("The run without a mutant", element("div", still, class_="stage") if still else ""),
    )
    return article(entry.identity, entry.status, header, body)


def _reasons(scenario: ProvenScenario, links: dict[str, PageEntry], options: ReportOptions) -> Html:
    """Return why a scenario has no mutants, and its survivors with the expectations to paste."""
    sections = []
    if not scenario.is_proven:
        place = faint(source(scenario.location, options))
        sections.append(reason("inconclusive", element("h3", "No mutants"), scenario.reason, place))
    for suggestion, survivors in by_suggestion(scenario):
        parts = [
            joined(
                element("h3", element("a", survivor.name, href=f"#{links[survivor.name].identity}")),
                element("p", survivor_text(survivor), class_="what"),
            )
            for survivor in survivors
        ]
        sections.append(element("section", *parts, _suggestion(suggestion, survivors), class_="reason inconclusive"))
    return element("div", *sections, class_="reasons") if sections else Html("")


def _suggestion(suggestion: str, survivors: Sequence[MutantResult]) -> Html:
    words = suggestion_title(suggestion, survivors)
    title = faint(f"{words[0].upper()}{words[1:]}")
    if not suggestion:
        return title
    shown = element("pre", element("code", suggestion), tabindex="0")
    return joined(title, element("div", shown, class_="command"))


def _survivor_article(entry: PageEntry, result: MutantResult, original: PageEntry, still: Html) -> Html:
    """Return the article of a survivor; the run without a mutant is a ghost in its player."""
    about = element("p", "A mutant of ", element("a", original.name, href=f"#{original.identity}"), class_="faint")
    ends = "" if entry.outcome is None else simulated_text(entry.outcome)
    status = element("p", "Nothing noticed this", class_="status inconclusive")
    body = (
        reasons([reason("inconclusive", Html(""), survivor_text(result), _suggestion(result.suggestion, [result]))]),
        element("h3", f"With the fault: {result.words}"),
        element("div", still, class_="stage"),
    )
    return article(
        entry.identity,
        "survivor",
        (status, heading(entry.identity, entry.name), about, faint(ends)),
        Html("".join(body)),
    )
