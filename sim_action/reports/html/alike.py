"""Failures that look alike: scenarios that touched or came too near to one body, or missed the same expectation."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final, TypeAlias

from sim_action.core.wording import counted
from sim_action.reports.escaping import one_line
from sim_action.reports.formatting import moment
from sim_action.reports.html.changes import ScenarioChange
from sim_action.reports.html.document import Html, element, joined
from sim_action.reports.html.sightings import first_seen_words
from sim_action.reports.scenario_groups import ScenarioGroup
from sim_action.results.outcome import ExpectationOutcome, Outcome
from sim_action.state.verdict import Verdict

if TYPE_CHECKING:
    from sim_action.reports.html.small_path import RunLook

_Failed: TypeAlias = tuple[Outcome, ExpectationOutcome]
"""A failed run, and the expectation that failed first."""

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
    if not several:
        return Html("")
    items = [_item(failures, ids, looks, _shared(failures, changes)) for failures in several[:_MAX_KINDS]]
    return joined(element("h3", "Failures that look alike"), element("ul", *items, class_="remarks alike"))


def _failures(groups: Iterable[ScenarioGroup]) -> Iterator[_Failed]:
    """Yield each failed run that counts by itself, with the expectation that failed first."""
    for group in groups:
        if group.gate is not None or group.is_part:
            continue
        for outcome in group.outcomes:
            failed = [each for each in outcome.expectations if each.failed and not each.verdict.cut_off]
            if failed:
                yield outcome, min(failed, key=_time)


def _scenarios(failures: Iterable[_Failed]) -> set[tuple[str, str]]:
    return {(outcome.file, outcome.group or outcome.name) for outcome, _ in failures}


def _time(expected: ExpectationOutcome) -> float:
    time = expected.verdict.time
    return float("inf") if time is None else time


def _kind(failures: Iterable[_Failed]) -> str:
    """Return the words for failures of one kind, such as "touched pallet, or came too near"."""
    expected = [each for _, each in failures]
    if not (body := expected[0].verdict.body):
        return f"failed {expected[0].name}"
    near = [_is_apart(each.verdict) for each in expected]
    if all(near):
        return f"came too near to {body}"
    return f"touched {body}{', or came too near' if any(near) else ''}"


def _is_apart(verdict: Verdict) -> bool:
    return verdict.unit == "m" and verdict.measured is not None and verdict.measured > 0.0


def _shared(failures: Sequence[_Failed], changes: Mapping[int, ScenarioChange]) -> str:
    worlds = {change.world if (change := changes.get(id(each))) else "" for each, _ in failures}
    return worlds.pop() if len(worlds) == 1 else ""


def _item(failures: Sequence[_Failed], ids: Mapping[int, str], looks: Mapping[int, RunLook], shared: str) -> Html:
    noun = "scenario" if len(_scenarios(failures)) == len(failures) else "run"
    told: list[str] = [element("b", f"{counted(len(failures), noun)} {one_line(_kind(failures))}")]
    told += [". Since the base run, ", element("b", shared), ": "] if shared else [": "]
    for number, (outcome, expected) in enumerate(failures[:_MAX_NAMES]):
        name, time = one_line(outcome.name), expected.verdict.time
        place = ids.get(id(outcome))
        told += ["; " if number else "", name if place is None else element("a", name, href=f"#{place}")]
        told += [] if time is None else [f" at {moment(time)}"]
        # Without a body, the words name the expectation.
        if body := expected.verdict.body:
            seen = look.seen.get(body) if (look := looks.get(id(outcome))) else None
            told.append(f" ({one_line(expected.assertion)}{'' if seen is None else f', {first_seen_words(seen)}'})")
    more = len(failures) - _MAX_NAMES
    return element("li", *told, f" and {more} more" if more > 0 else "")
