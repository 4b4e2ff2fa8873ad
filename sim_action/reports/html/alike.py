"""Failures that look alike: scenarios that touched the same body, or missed the same expectation."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final

from sim_action.core.wording import counted
from sim_action.reports.escaping import one_line
from sim_action.reports.formatting import moment
from sim_action.reports.html.changes import ScenarioChange
from sim_action.reports.html.document import Html, element, joined
from sim_action.reports.scenario_groups import ScenarioGroup
from sim_action.results.outcome import ExpectationOutcome, Outcome

if TYPE_CHECKING:
    from sim_action.recording.replay.sightings import SightingData
    from sim_action.reports.html.small_path import RunLook

_MAX_KINDS: Final = 8
_MAX_NAMES: Final = 12
# Messages on contacts begin with the link of the robot that touched something.
_TOUCH: Final = re.compile(r"\btouched (.+?) at \d+\.\d\d s\b")


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
    kinds: dict[str, list[tuple[Outcome, ExpectationOutcome]]] = {}
    for outcome, expected in _failures(groups):
        kinds.setdefault(_kind(expected), []).append((outcome, expected))
    # Variations of one scenario stand together in the table.
    several = [kind for kind in kinds.items() if len(_scenarios(kind[1])) > 1]
    several.sort(key=lambda kind: len(kind[1]), reverse=True)
    if not several:
        return Html("")
    items = []
    for words, failures in several[:_MAX_KINDS]:
        shared = _shared([outcome for outcome, _ in failures], _touched(failures[0][1]), looks, changes)
        items.append(_item(words, failures, ids, shared))
    return joined(element("h3", "Failures that look alike"), element("ul", *items, class_="remarks alike"))


def _failures(groups: Iterable[ScenarioGroup]) -> Iterator[tuple[Outcome, ExpectationOutcome]]:
    """Yield each failed run that counts by itself, with the expectation that failed first."""
    for group in groups:
        if group.gate is not None or group.is_part:
            continue
        for outcome in group.outcomes:
            failed = [each for each in outcome.expectations if each.failed and not each.verdict.cut_off]
            if failed:
                yield outcome, min(failed, key=_time)


def _scenarios(failures: Iterable[tuple[Outcome, ExpectationOutcome]]) -> set[tuple[str, str]]:
    """Return file and name of each scenario; all variations of one have the same."""
    return {(outcome.file, outcome.group or outcome.name) for outcome, _ in failures}


def _time(expected: ExpectationOutcome) -> float:
    time = expected.verdict.time
    return float("inf") if time is None else time


def _kind(expected: ExpectationOutcome) -> str:
    """Return the words for a kind of failure."""
    touched = _touched(expected)
    return f"touched {touched} ({expected.assertion})" if touched else f"failed {expected.name}"


def _touched(expected: ExpectationOutcome) -> str:
    """Return the name of the body that was touched; empty if the failure is another one."""
    # What a link touches in self_collision is another link.
    touch = None if expected.assertion == "self_collision" else _TOUCH.search(expected.verdict.message)
    return touch[1] if touch else ""


def _shared(
    outcomes: Sequence[Outcome], touched: str, looks: Mapping[int, RunLook], changes: Mapping[int, ScenarioChange]
) -> str:
    """Return what changed in the worlds of all runs, and which sensor saw the touched body first in all of them."""
    told = []
    worlds = {change.world if (change := changes.get(id(each))) else "" for each in outcomes}
    if len(worlds) == 1 and (world := worlds.pop()):
        told.append(f"since the base run, {world}")
    seen = [look.seen.get(touched) if (look := looks.get(id(each))) else None for each in outcomes]
    first = [sighting for sighting in seen if sighting is not None]
    if len(first) == len(seen) and len({(each.sensor, each.kind) for each in first}) == 1:
        told.append(_first_seen(first))
    return "; ".join(told)


def _first_seen(first: Sequence[SightingData]) -> str:
    """Return the words for sightings by one sensor, such as "first seen by skirt (lidar) at 1.40 s"."""
    times = sorted(each.time for each in first)
    earliest, latest = moment(times[0]), moment(times[-1])
    sensor = f"{one_line(first[0].sensor)} ({one_line(first[0].kind)})"
    return f"first seen by {sensor} at {earliest}{'' if earliest == latest else f' to {latest}'}"


def _item(words: str, failures: list[tuple[Outcome, ExpectationOutcome]], ids: Mapping[int, str], shared: str) -> Html:
    noun = "scenario" if len(_scenarios(failures)) == len(failures) else "run"
    told: list[str] = [element("b", f"{counted(len(failures), noun)} {one_line(words)}"), ": "]
    for number, (outcome, expected) in enumerate(failures[:_MAX_NAMES]):
        name, time = one_line(outcome.name), expected.verdict.time
        place = ids.get(id(outcome))
        told += [", " if number else "", name if place is None else element("a", name, href=f"#{place}")]
        told += [] if time is None else [f" at {moment(time)}"]
    more = len(failures) - _MAX_NAMES
    return element("li", *told, f" and {more} more" if more > 0 else "", f"; {shared}" if shared else "")
