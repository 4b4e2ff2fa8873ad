"""`report.html`: the whole run in one file, which opens from a disk and fetches nothing."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import chain, count
from math import isfinite
from pathlib import Path
from typing import Final

from sim_action.core.files import whole_file
from sim_action.recording.replay import Replay
from sim_action.recording.replay.storage import ReplayError, read
from sim_action.reports import ReportOptions
from sim_action.reports.escaping import one_line
from sim_action.reports.groups import groups, worst_first
from sim_action.reports.page.article import article, drawn
from sim_action.reports.page.document import Page
from sim_action.reports.page.listing import head, headline, listing
from sim_action.reports.page.markup import element, joined
from sim_action.reports.page.packing import Parcel, told
from sim_action.reports.reproduction import REPORT_FILE
from sim_action.reports.wording import mood
from sim_action.results.file import Results
from sim_action.results.outcome import Outcome
from sim_action.results.trace_files import number_among_namesakes, stored_file

MOST_SCENARIOS: Final = 2_000
"""What comes after these, a page only counts; failures come first."""


def write_html(results: Results, options: ReportOptions) -> None:
    """Writes `report.html` into the output folder."""
    with whole_file(options.folder / REPORT_FILE) as file:
        file.write(page(results, options).text().encode("utf-8", errors="replace"))


def page(results: Results, options: ReportOptions) -> Page:
    """The list, an article for each scenario, and the replays that there is room for."""
    found = worst_first(groups(results.outcomes))
    ordered = [outcome for group in found for outcome in group.worst_first()][:MOST_SCENARIOS]
    ids = {id(outcome): f"s{number}" for number, outcome in enumerate(ordered)}
    parcel, numbers = Parcel(), _numbers(ordered)
    articles, entries = [], []
    for outcome in ordered:
        identity = ids[id(outcome)]
        replay, missing = _replay(outcome, options.folder)
        if replay is not None and not parcel.takes(f"replay-{identity}", replay):
            replay, missing = None, "No room was left for the replay of this run: failures come first."
        still = element("p", missing, class_="faint") if replay is None else drawn(replay, outcome)
        articles.append(article(identity, outcome, results, options, still))
        entries.append(_entry(identity, outcome, numbers[id(outcome)], replay))
    body = joined(
        head(results),
        element("div", joined(listing(found, ids), element("main", joined(*articles))), class_="layout"),
    )
    blocks = parcel.blocks | ({"meshes": parcel.shared} if parcel.meshes else {})
    title = f"{headline(results)} · sim-action"
    return Page(title, results.conclusion != "success", body, told({"scenarios": entries}), blocks)


def _replay(outcome: Outcome, folder: Path) -> tuple[Replay | None, str]:
    """What there is to see of a run, or why there is nothing."""
    if outcome.replay is None:
        return None, "" if outcome.digest is None else "No replay of this run was kept."
    path = stored_file(folder, outcome.replay)
    if path is None:
        return None, "The replay of this run is not where its results say."
    try:
        return read(path), ""
    except ReplayError as error:
        return None, f"There is no replay: {one_line(str(error))}"


def _numbers(outcomes: Sequence[Outcome]) -> dict[int, int]:
    """By ids of outcomes: which of several of its name each is, told from its replay as links from elsewhere are."""
    taken: defaultdict[str, set[int]] = defaultdict(set)
    # Where to go on looking for the next that is free: many may have the same name.
    free: defaultdict[str, Iterator[int]] = defaultdict(lambda: count(1))
    numbers = {}
    for outcome in sorted(outcomes, key=lambda outcome: outcome.replay is None):
        name = one_line(outcome.name)
        stated = number_among_namesakes(outcome.name, outcome.replay or "")
        number = next(number for number in chain([stated], free[name]) if number not in taken[name])
        taken[name].add(number)
        numbers[id(outcome)] = number
    return numbers


def _entry(identity: str, outcome: Outcome, number: int, replay: Replay | None) -> dict[str, object]:
    """What the page's script has to know of a scenario."""
    return {
        "id": identity,
        "name": one_line(outcome.name),
        "number": number,
        "status": mood(outcome),
        "replay": None if replay is None else f"replay-{identity}",
        "moment": next((time for failure in outcome.failures if (time := _moment(failure.time)) is not None), None),
        "expectations": [
            {
                "name": one_line(expected.name),
                "status": "passed" if expected.verdict.passed else "warned" if expected.warned else "failed",
                "time": _moment(expected.verdict.time),
                "cutOff": expected.verdict.cut_off,
            }
            for expected in outcome.expectations
        ],
    }


def _moment(time: float | None) -> float | None:
    """A time in s that JSON can tell; results may be a stranger's."""
    return time if time is not None and isfinite(time) else None
