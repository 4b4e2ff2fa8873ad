"""The report `report.html`: a whole run in one file that opens from a disk and loads nothing from the network.

This module assembles the page: head, list of scenarios, an article for each, and the replays that fit.
"""

from __future__ import annotations

import zlib
from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import chain
from math import isfinite
from typing import TYPE_CHECKING, Final

from sim_action.core.files import whole_file
from sim_action.recording.replay.replay_data import ReplayReader
from sim_action.reports import ReportOptions
from sim_action.reports.escaping import one_line
from sim_action.reports.formatting import counts_text, run_headline, shard_text, took_text
from sim_action.reports.html.document import (
    Html,
    Page,
    ReplayBlocks,
    element,
    encoded,
    joined,
    packed,
    packed_article,
    page_header,
    page_json,
    replay_id,
    stored_replay,
)
from sim_action.reports.html.ghosts import Ghost, GhostSources
from sim_action.reports.html.navigation import PageEntry, PagePlan, planned_page, scenario_list
from sim_action.reports.html.scenario_article import drawn, first_seen, run_article
from sim_action.reports.html.top_view import RunLook, SceneOutlines, small_path
from sim_action.reports.scenario_groups import grouped_scenarios
from sim_action.results.artifacts import REPORT_FILE
from sim_action.results.results_json import Results

if TYPE_CHECKING:
    from sim_action.reports.html.base_run import Base

MAX_PAGE_SCENARIOS: Final = 2_000
"""The number of scenarios on a page, the worst first; further scenarios are only counted."""

MAX_PARSED_ARTICLES: Final = 200
"""On a page with more articles, browsers with scripts parse an article when it is opened."""


def write_html(results: Results, options: ReportOptions) -> None:
    """Write `report.html` into the output folder."""
    if options.against is not None:
        from sim_action.reports.html.base_run import warn_if_nothing_in_common  # a usual run does without it

        warn_if_nothing_in_common(options.against, results.outcomes)
    with whole_file(options.folder / REPORT_FILE) as file:
        file.writelines(page(results, options).parts())


def page(results: Results, options: ReportOptions) -> Page:
    """Return the page with the list, an article for each scenario, run and gate, and the replays that fit."""
    plan = planned_page(grouped_scenarios(results.outcomes, results.gates), MAX_PAGE_SCENARIOS)
    blocks = ReplayBlocks()
    base = _base_run(results, options)
    ghosts = GhostSources(results.runs, plan.ids, options.folder, base)
    articles, looks = _run_articles(plan, results, options, blocks, ghosts)
    plots = _group_articles(plan, options, blocks, articles, ghosts)
    main = Html('<main id="main" tabindex="-1">' if plan.has_suite else "<main>")
    head = f'{page_head(results, base)}\n<div class="layout">{joined(scenario_list(plan, results), main)}'
    form = packed_article if len(plan.entries) > MAX_PARSED_ARTICLES else bytes
    parts: Iterable[bytes] = (form(zlib.decompress(articles.pop(entry.identity))) for entry in plan.entries)
    if plan.has_suite:
        from sim_action.reports.html.suite import suite_article  # a usual run does without it

        parts = chain([encoded(suite_article(plan, looks, ghosts.changes))], parts)
    body = chain([encoded(head)], _lines(parts), [b"</main></div>"])
    title = f"{run_headline(results)[1]} · sim-action"
    index = page_json(
        {
            "scenarios": [
                index_entry(entry, blocks, plots, ghosts.by_article.get(entry.identity, ())) for entry in plan.entries
            ]
        }
    )
    carried = blocks.carried | {_sweep_id(identity): block for identity, block in plots.items()}
    return Page(title, results.conclusion != "success", body, index, carried, has_replays=bool(blocks.blocks))


def _packed(article: Html) -> bytes:
    """Return an article as it waits until the page is written: thousands have tens of megabytes."""
    return zlib.compress(encoded(article), 1)


def _lines(parts: Iterable[bytes]) -> Iterator[bytes]:
    for number, part in enumerate(parts):
        yield b"\n%b" % part if number else part


def _base_run(results: Results, options: ReportOptions) -> Base | None:
    """Return the run of `--against` with what changed since; None if there is none."""
    if options.against is None:
        return None
    from sim_action.reports.html.base_run import Base  # a usual run does without it

    return Base.of(options.against, results)


def _sweep_id(identity: str) -> str:
    return f"sweep-{identity}"


def _run_articles(
    plan: PagePlan, results: Results, options: ReportOptions, blocks: ReplayBlocks, ghosts: GhostSources
) -> tuple[dict[str, bytes], dict[int, RunLook]]:
    """Return the packed articles of runs by element id, worst first, and by `id()` of an outcome its replay's look."""
    reader = ReplayReader()
    outlines = SceneOutlines()
    articles: dict[str, bytes] = {}
    looks: dict[int, RunLook] = {}
    passes = False
    for outcome in plan.runs:
        if not passes and (passes := outcome.status == "passed"):
            ghosts.settle(blocks)
        identity = plan.ids[id(outcome)]
        recorded, missing = stored_replay(outcome, options.folder, reader)
        replay = recorded
        if replay is not None and plan.has_suite:
            looks[id(outcome)] = RunLook(small_path(replay, outcome.display_status), first_seen(replay))
        if replay is not None and not blocks.add(replay_id(identity), replay):
            replay, missing = None, "The replay of this run is not included: the size of the page is limited."
        still = element("p", missing, class_="faint") if replay is None else drawn(replay, outcome, outlines)
        since = ghosts.since(identity, outcome, replay)
        gate = plan.gates.get((outcome.file, outcome.gate), "")
        articles[identity] = _packed(
            run_article(identity, outcome, results, options, still, gate=gate, replay=recorded, since=since)
        )
    ghosts.settle(blocks)
    return articles, looks


def _group_articles(
    plan: PagePlan, options: ReportOptions, blocks: ReplayBlocks, articles: dict[str, bytes], ghosts: GhostSources
) -> dict[str, str]:
    """Add the articles of gates and variations to `articles`. Return the packed data of their plots by element id."""
    if all(entry.group is None for entry in plan.entries):
        return {}
    from sim_action.reports.html.gate_article import (  # most scenarios have one run
        GroupPlace,
        gate_article,
        sweep,
        variations_article,
    )

    replayed = frozenset(entry.identity for entry in plan.entries if replay_id(entry.identity) in blocks.blocks)
    plots = {}
    for entry in plan.entries:
        if (group := entry.group) is None:
            continue
        gate = group.gate
        passes = None if group.planned is None else group.planned.gate.passes
        data = sweep(group.outcomes, plan.ids, None if passes is None else passes.at_least)
        if data is not None:
            plots[entry.identity] = packed(page_json(data).encode())
        place = GroupPlace(entry.identity, plan.ids, replayed, data is not None)
        if gate is None:
            written = variations_article(group, place, options)
        else:
            written = gate_article(group, gate, place, options, ghosts.since(entry.identity, gate, None))
        articles[entry.identity] = _packed(written)
    return plots


def index_entry(
    entry: PageEntry, blocks: ReplayBlocks, plots: Collection[str], ghosts: Sequence[Ghost] = ()
) -> dict[str, object]:
    """Return the data of an article for the script of the page."""
    outcome = entry.outcome
    failures = () if outcome is None else outcome.failures
    expectations = () if outcome is None or outcome.statistics is not None else outcome.expectations
    return {
        "id": entry.identity,
        "kind": entry.kind,
        "name": entry.name,
        "number": entry.number,
        "status": entry.status,
        "replay": replay_id(entry.identity) if replay_id(entry.identity) in blocks.blocks else None,
        "sweep": _sweep_id(entry.identity) if entry.identity in plots else None,
        "moment": next((time for failure in failures if (time := _moment(failure.time)) is not None), None),
        "expectations": [
            {
                "name": one_line(expected.name),
                "status": expected.status,
                "time": _moment(expected.verdict.time),
                "cutOff": expected.verdict.cut_off,
            }
            for expected in expectations
        ],
        "ghosts": [ghost.entry(blocks) for ghost in ghosts],
    }


def _moment(time: float | None) -> float | None:
    return time if time is not None and isfinite(time) else None


def page_head(results: Results, base: Base | None = None) -> Html:
    """Return the head of the page: headline, counts, speed and version, and the changes since an earlier run."""
    facts = [f"{counts_text(results)} in {took_text(results)}"]
    facts += [shard_text(results.shard)] if results.shard else []
    facts += [f"sim-action {results.sim_action}"]
    worst = next((outcome.status for outcome in results.worst_first()), None)
    open_kinds = ("inconclusive", "not_exercised")
    kind = "passed" if results.conclusion == "success" else worst if worst in open_kinds else "failed"
    return page_header(run_headline(results)[1], kind, " · ".join(facts), "" if base is None else base.headline)
