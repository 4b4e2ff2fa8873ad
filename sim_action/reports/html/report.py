"""The report `report.html`: a whole run in one file that opens from a disk and loads nothing from the network.

This module assembles the page: head, list of scenarios, an article for each, and the replays that fit.
"""

from __future__ import annotations

import base64
import gzip
import json
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain, count
from math import isfinite
from pathlib import Path
from typing import Final

from sim_action.core.files import whole_file
from sim_action.core.records import dataclass, field
from sim_action.core.wording import counted, shortened
from sim_action.recording.replay.replay_file import Replay, ReplayError, ReplayReader
from sim_action.recording.replay.shapes import MeshData
from sim_action.reports import ReportOptions
from sim_action.reports.escaping import one_line
from sim_action.reports.formatting import counts_text, shard_text, speed_text
from sim_action.reports.html.document import Html, Page, element, encoded, joined
from sim_action.reports.html.scenario_article import article, drawn, status_mark
from sim_action.reports.html.top_view import SceneOutlines
from sim_action.reports.scenario_groups import ScenarioGroup, grouped_scenarios, worst_first
from sim_action.results.artifacts import REPORT_FILE, namesake_number, stored_file
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results

MAX_PAGE_SCENARIOS: Final = 2_000
"""The number of scenarios on a page, the worst first; further scenarios are only counted."""


def write_html(results: Results, options: ReportOptions) -> None:
    """Write `report.html` into the output folder."""
    with whole_file(options.folder / REPORT_FILE) as file:
        file.writelines(page(results, options).parts())


def page(results: Results, options: ReportOptions) -> Page:
    """Return the page with the list, an article for each scenario, and the replays that fit."""
    found = worst_first(grouped_scenarios(results.outcomes))
    ordered = [outcome for group in found for outcome in group.worst_first()][:MAX_PAGE_SCENARIOS]
    ids = {id(outcome): f"s{number}" for number, outcome in enumerate(ordered)}
    replay_blocks, numbers = ReplayBlocks(), _numbers(ordered)
    reader, outlines = ReplayReader(), SceneOutlines()
    articles: list[bytes] = []
    entries = []
    for outcome in ordered:
        identity = ids[id(outcome)]
        replay, missing = _replay(outcome, options.folder, reader)
        if replay is not None and not replay_blocks.add(f"replay-{identity}", replay):
            replay, missing = None, "The replay of this run is not included: the size of the page is limited."
        still = element("p", missing, class_="faint") if replay is None else drawn(replay, outcome, outlines)
        articles.append(encoded(article(identity, outcome, results, options, still) + "\n"))
        entries.append(_index_entry(identity, outcome, numbers[id(outcome)], replay))
    if articles:
        articles[-1] = articles[-1].removesuffix(b"\n")
    head = f'{page_head(results)}\n<div class="layout">{joined(scenario_list(found, ids), Html("<main>"))}'
    body = (encoded(head), *articles, b"</main></div>")
    blocks = replay_blocks.blocks | ({"meshes": replay_blocks.shared} if replay_blocks.meshes else {})
    title = f"{page_headline(results)} · sim-action"
    return Page(title, results.conclusion != "success", body, page_json({"scenarios": entries}), blocks)


def _replay(outcome: Outcome, folder: Path, reader: ReplayReader) -> tuple[Replay | None, str]:
    """Return the replay of a run, or None and the reason why there is none."""
    if outcome.replay is None:
        return None, "" if outcome.digest is None else "No replay of this run was stored."
    path = stored_file(folder, outcome.replay)
    if path is None:
        return None, "The replay file of this run is missing."
    try:
        return reader.read(path), ""
    except ReplayError as error:
        return None, f"The replay cannot be read: {one_line(str(error))}"


def _numbers(outcomes: Sequence[Outcome]) -> dict[int, int]:
    """Return `id()` of an outcome -> its number among those of its name, equal to the number in links to its replay."""
    taken: defaultdict[str, set[int]] = defaultdict(set)
    # The next number to try for a name, so that many equal names do not take quadratic time.
    free: defaultdict[str, Iterator[int]] = defaultdict(lambda: count(1))
    numbers = {}
    for outcome in sorted(outcomes, key=lambda outcome: outcome.replay is None):
        name = one_line(outcome.name)
        stated = namesake_number(outcome.name, outcome.replay or "")
        number = next(number for number in chain([stated], free[name]) if number not in taken[name])
        taken[name].add(number)
        numbers[id(outcome)] = number
    return numbers


def _index_entry(identity: str, outcome: Outcome, number: int, replay: Replay | None) -> dict[str, object]:
    """Return the data of a scenario for the script of the page."""
    return {
        "id": identity,
        "name": one_line(outcome.name),
        "number": number,
        "status": outcome.display_status,
        "replay": None if replay is None else f"replay-{identity}",
        "moment": next((time for failure in outcome.failures if (time := _moment(failure.time)) is not None), None),
        "expectations": [
            {
                "name": one_line(expected.name),
                "status": expected.status,
                "time": _moment(expected.verdict.time),
                "cutOff": expected.verdict.cut_off,
            }
            for expected in outcome.expectations
        ],
    }


def _moment(time: float | None) -> float | None:
    """Return a time in s, or None if it is not finite and JSON cannot hold it; results may come from anywhere."""
    return time if time is not None and isfinite(time) else None


_MAX_IN_GIST = 110


def page_headline(results: Results) -> str:
    """Return the headline: the number of scenarios that did not pass."""
    bad = results.total - results.count("passed") - results.count("skipped")
    if not results.total:
        return "No scenarios were run"
    if results.conclusion == "cancelled":
        return f"Interrupted: {results.count('passed')} of {results.total} scenarios had passed"
    if not bad:
        return "The scenario passed" if results.total == 1 else f"All {results.total} scenarios passed"
    return "The scenario did not pass" if results.total == 1 else f"{bad} of {results.total} scenarios did not pass"


def page_head(results: Results) -> Html:
    """Return the head of the page: headline, counts, speed and version."""
    speed = f" ({speed_text(results.real_time_factor)})" if results.real_time_factor else ""
    told = [f"{counts_text(results)} in {results.wall_time:.1f} s{speed}"]
    told += [shard_text(results.shard)] if results.shard else []
    told += [f"sim-action {results.sim_action}"]
    worst = next((outcome.status for outcome in results.worst_first()), None)
    kind = "passed" if results.conclusion == "success" else "not_exercised" if worst == "not_exercised" else "failed"
    return element(
        "header",
        element("h1", page_headline(results), class_=kind),
        element("p", " · ".join(told), class_="faint"),
        class_="run",
    )


def scenario_list(found: list[ScenarioGroup], ids: Mapping[int, str]) -> Html:
    """Return the list of scenarios; empty for a single scenario.

    `ids` maps `id()` of an outcome to its element id, for outcomes that have an article.
    """
    total = sum(len(group.outcomes) for group in found)
    if total < 2:
        return Html("")
    left = total - len(ids)
    more = element(
        "p",
        f"{counted(left, 'more scenario')} in results.json; this page shows the worst {len(ids)}.",
        class_="faint none",
    )
    return element(
        "nav",
        element(
            "details",
            element("summary", f"{total} scenarios"),
            element("ol", *(_list_entry(group, ids) for group in found)),
            more if left else "",
            open=True,
        ),
        aria_label="Scenarios",
        class_="scenarios",
    )


def _gist(outcome: Outcome) -> str:
    """Return the first reason why a scenario did not pass, shortened; empty if it passed."""
    told = [failure.message for failure in outcome.failures]
    told += [expected.verdict.message for expected in outcome.not_passed]
    return shortened(one_line(told[0]), _MAX_IN_GIST) if told else ""


def _list_entry(group: ScenarioGroup, ids: Mapping[int, str]) -> Html:
    there = [outcome for outcome in group.worst_first() if id(outcome) in ids]
    if not there:
        return Html("")
    if not group.varies:
        return _list_item(there[0], there[0].name, ids)
    title = joined(
        status_mark(group.status),
        element("span", one_line(group.name), element("small", group.passed, class_="faint"), class_="name"),
    )
    items = [_list_item(outcome, group.values(outcome), ids) for outcome in there]
    fold = element("details", element("summary", title), element("ol", *items), open=group.status != "passed")
    return element("li", fold, class_="group")


def _list_item(outcome: Outcome, name: str, ids: Mapping[int, str]) -> Html:
    why = _gist(outcome)
    return element(
        "li",
        element(
            "a",
            status_mark(outcome.display_status),
            element("span", one_line(name), element("small", why, class_="faint") if why else "", class_="name"),
            href=f"#{ids[id(outcome)]}",
        ),
    )


MAX_REPLAY_BYTES: Final = 8_000_000
"""The size of all replays and meshes in a page; scenarios beyond it, the best ones, get no replay."""

# Level 9 takes four times as long, for 1 % less.
_LEVEL: Final = 6


def packed(data: bytes) -> str:
    """Return data as gzip in base64, identical for identical data."""
    return base64.b64encode(gzip.compress(data, _LEVEL, mtime=0)).decode("ascii")


def page_json(data: object) -> str:
    """Return JSON that is safe inside a script element: it contains no `<`."""
    return json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")


@dataclass(slots=True)
class ReplayBlocks:
    """The packed replays of a page and the meshes that they share; `size` is an upper bound in bytes."""

    blocks: dict[str, str] = field(default_factory=dict)
    meshes: dict[str, MeshData] = field(default_factory=dict)
    size: int = 0

    def add(self, identity: str, replay: Replay) -> bool:
        """Add a replay if it fits; return False if it does not."""
        block = packed(replay.model_dump_json(exclude={"scene": {"meshes"}}, exclude_none=True).encode())
        new = {digest: mesh for digest, mesh in replay.scene.meshes.items() if digest not in self.meshes}
        size = self.size + len(block) + (len(_packed_meshes(new)) if new else 0)
        if size > MAX_REPLAY_BYTES:
            return False
        self.size = size
        self.blocks[identity] = block
        self.meshes |= new
        return True

    @property
    def shared(self) -> str:
        """The packed meshes by digest."""
        return _packed_meshes(self.meshes)


def _packed_meshes(meshes: Mapping[str, MeshData]) -> str:
    return packed(page_json({digest: mesh.model_dump() for digest, mesh in meshes.items()}).encode())
