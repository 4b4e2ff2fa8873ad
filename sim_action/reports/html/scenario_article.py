"""The article of one scenario in the page: reasons of a failure, drawing, expectations, details of the run."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Final

from sim_action.core import units
from sim_action.core.wording import excerpt
from sim_action.recording.replay.replay_data import Replay
from sim_action.recording.replay.sightings import BlindData, ObstacleData, SightingData
from sim_action.reports import ReportOptions
from sim_action.reports.display import INFORMATION, STATUS_DISPLAYS
from sim_action.reports.escaping import one_line
from sim_action.reports.formatting import moment, run_facts, simulated_text, speed_text, timeline, user_output
from sim_action.reports.html.document import (
    Html,
    article,
    bullets,
    dotted,
    element,
    faint,
    heading,
    html_table,
    joined,
    reason,
    reasons,
    source,
    status_mark,
    titled,
    value_link,
    values,
)
from sim_action.reports.html.top_view import SceneOutlines, drawing
from sim_action.reports.links import rerun_command, scenario_lines
from sim_action.reports.table import NUMBERS, Table, expectation_rows, numbers
from sim_action.results.outcome import DisplayStatus, ExpectationOutcome, Failure, Outcome
from sim_action.results.results_json import Results
from sim_action.state.verdict import Verdict
from sim_action.world.claims import AuditWarning


def run_article(
    identity: str,
    outcome: Outcome,
    results: Results,
    options: ReportOptions,
    still: Html,
    *,
    gate: str = "",
    replay: Replay | None = None,
    since: str = "",
) -> Html:
    """Return the article of a scenario.

    Args:
        identity: its element id.
        outcome: the outcome of its run.
        results: the results of all runs.
        options: the options of the report.
        still: the drawing shown without scripts.
        gate: the element id of the article of the gate that judges this run, if it has one.
        replay: the recording of the run, also if the page has no room for it.
        since: what changed since an earlier run.
    """
    kind = outcome.display_status
    header = (
        status_line(kind, STATUS_DISPLAYS[kind].headline),
        _gate_line(outcome, gate) if outcome.is_sample else "",
        heading(identity, one_line(outcome.name)),
        element("p", _origin_line(outcome, options), class_="faint"),
        element("p", since, class_="since") if since else "",
    )
    items = [element("li", value_link(mark.time), f" {mark.words}") for mark in timeline(outcome)]
    body = joined(
        run_reasons(outcome, options, {} if replay is None else first_seen(replay)),
        titled("What happened before", bullets(items, "timeline")),
        element("div", still, class_="stage"),
        "" if replay is None else sightings(replay),
        expectations(outcome, options),
        scenario_source(outcome, options),
        measurements(outcome),
        details(outcome, results, options),
    )
    return article(identity, f"{kind}{' sample' if outcome.is_sample else ''}", header, body)


def status_line(kind: DisplayStatus, words: str) -> Html:
    """Return the line with the status above a name."""
    symbol = element("span", STATUS_DISPLAYS[kind].symbol, aria_hidden="true")
    return element("p", symbol, " ", words, class_=f"status {kind}")


def _gate_line(outcome: Outcome, gate: str) -> Html:
    name = one_line(outcome.gate or "")
    return element("p", "One run of the gate ", element("a", name, href=f"#{gate}") if gate else name, class_="faint")


def _origin_line(outcome: Outcome, options: ReportOptions) -> Html:
    """Return the line with the place in the scenario file, sim time, speed and engine."""
    speed = speed_text(outcome.real_time_factor)
    return dotted((source(outcome.location, options), simulated_text(outcome), speed, outcome.engine or ""))


def drawn(replay: Replay, outcome: Outcome, outlines: SceneOutlines) -> Html:
    """Return the drawing of a run with its caption."""
    words = "View from above: the path of the robot, its start (outlined) and its end."
    return element("figure", drawing(replay, outcome, outlines), element("figcaption", words), class_="still")


_MAX_FAILURES = 20
_MAX_WARNINGS = 100
_MAX_MEASUREMENTS = 100


def run_reasons(outcome: Outcome, options: ReportOptions, seen: Mapping[str, SightingData]) -> Html:
    """Return why a scenario did not pass, with value, limit, time and margin; `seen`: body -> first sighting."""
    sections = failure_sections(outcome, options)
    sections += [_missed_section(outcome, expected, seen.get(expected.verdict.body)) for expected in outcome.not_passed]
    sections += [_warning_section(warning, outcome, options) for warning in outcome.warnings[:_MAX_WARNINGS]]
    return reasons(sections)


def failure_sections(outcome: Outcome, options: ReportOptions) -> list[Html]:
    """Return the reasons why there is no verdict."""
    sections = [_failure_section(failure, options) for failure in outcome.failures[:_MAX_FAILURES]]
    left = len(outcome.failures) - _MAX_FAILURES
    return [*sections, faint(f"{left} more errors are in results.json.")] if left > 0 else sections


def expectations(outcome: Outcome, options: ReportOptions) -> Html:
    """Return the table of all expectations in the order of the scenario file."""
    if not outcome.expectations:
        return Html("")
    rows = expectation_rows(outcome, outcome.expectations)
    return titled("Expectations", html_table(Table("Expectation", rows, NUMBERS), options))


_AROUND: Final = 20


def scenario_source(outcome: Outcome, options: ReportOptions) -> Html:
    """Return the lines of its file about the places that failed; empty if it passed, or the file cannot be read."""
    if outcome.status in ("passed", "skipped") or not outcome.file:
        return Html("")
    places = [failure.location for failure in outcome.failures]
    places += [expected.location for expected in outcome.causes]
    failed = frozenset(place.line for place in places if place and place.line and place.file == outcome.file)
    return _marked_source(options.workspace, outcome.file, failed, outcome.line or 1)


# Variations and gates have many runs of one file.
@lru_cache(maxsize=64)
def _marked_source(workspace: Path, file: str, marked: frozenset[int], begin: int) -> Html:
    """Return the lines about the marked ones; without one, those about the line where the scenario begins."""
    lines = excerpt(scenario_lines(workspace, file), marked or {begin}, _AROUND)
    width = len(str(lines[-1].number)) if lines else 0
    shown = [element("mark" if marked and line.is_marked else "span", f"{line.numbered(width)}\n") for line in lines]
    return titled("Scenario file", element("pre", *shown, class_="source", tabindex="0") if shown else "")


def measurements(outcome: Outcome) -> Html:
    """Return the values that were measured without a limit; empty if there are none."""
    mark = status_mark("information", neutral=True)
    items = [
        element(
            "li",
            mark,
            " ",
            measurement.message,
            " ",
            "" if measurement.time is None else value_link(measurement.time),
            _bar(measurement.left),
        )
        for measurement in outcome.measurements[:_MAX_MEASUREMENTS]
    ]
    has_margins = any(measurement.left for measurement in outcome.measurements)
    return titled("Margins" if has_margins else INFORMATION.headline, bullets(items, "measurements"))


def _bar(left: tuple[float | None, float | None] | None) -> Html:
    """Return the bar of a factor in a tornado chart: the rest of its range below and above its value."""
    if left is None:
        return Html("")
    marks = []
    for sign, share in ((sign, share) for sign, share in zip((-1, 1), left, strict=True) if share is not None):
        for kind, length in (("missed", 100.0), ("held", round(100 * share, 1))):
            marks.append(element("rect", x=min(0.0, sign * length), width=length, height=8, class_=kind))
    limit = element("rect", x=-0.4, width=0.8, height=8, class_="limit")
    box = {"viewBox": "-100 0 200 8", "preserveAspectRatio": "none"}
    return element("svg", *marks, limit, **box, aria_hidden="true", class_="tornado margin-bar")


def _failure_section(failure: Failure, options: ReportOptions) -> Html:
    return reason(
        "failed",
        element("h3", failure.title),
        failure.message,
        values([("at", "" if failure.time is None else value_link(failure.time))], "figures"),
        faint(source(failure.location, options)),
        element("pre", failure.details) if failure.details.strip() else "",
    )


def _missed_section(outcome: Outcome, expected: ExpectationOutcome, seen: SightingData | None) -> Html:
    verdict = expected.verdict
    return reason(
        "cut" if verdict.cut_off else expected.status,
        element("h3", expected.name, element("small", " · a warning") if expected.warned else ""),
        outcome.message_of(expected) or "It did not hold.",
        _figures(verdict),
        faint("" if seen is None else first_seen_words(seen)),
    )


def _warning_section(warning: AuditWarning, outcome: Outcome, options: ReportOptions) -> Html:
    kind = element("small", " · a warning, and the run is strict" if outcome.strict else " · a warning")
    status = "failed" if outcome.strict else "warned"
    return reason(status, element("h3", warning.rule, kind), warning.message, faint(source(warning.location, options)))


def _figures(verdict: Verdict) -> Html:
    """Return measured value, limit, missing margin and sim time, as far as they exist."""
    measured, limit, _, time = numbers(verdict)
    # The number of contacts above a limit of zero repeats the measured value.
    margin = 0.0 if verdict.margin is None or verdict.unit == "contacts" else verdict.margin
    missed = units.display(-margin, verdict.unit) if margin < 0 else ""
    named = {"measured": measured, "limit": limit, "missed by": missed, "at": value_link(time)}
    return values(named.items(), "figures")


_MAX_LINES = 200


def details(outcome: Outcome, results: Results, options: ReportOptions) -> Html:
    """Return the command to run a scenario again, messages, notes, output and facts of the run."""
    said = [(diagnostic.level, diagnostic.message) for diagnostic in outcome.diagnostics]
    command = rerun_command(outcome, options)
    return joined(
        titled(
            "Run it again",
            element("div", element("pre", element("code", command)), class_="command") if command else "",
        ),
        _said("Engine", said),
        _said("Notes", [("note", note) for note in (*outcome.model_notes, *outcome.notes)]),
        _printed(user_output(outcome)),
        titled("Run details", values(run_facts(outcome, results).items(), "facts")),
    )


def _said(title: str, remarks: Sequence[tuple[str, str]]) -> Html:
    items = [
        element("li", element("b", level, " ") if level != "note" else "", message)
        for level, message in remarks[:_MAX_LINES]
    ]
    left = len(remarks) - _MAX_LINES
    more = [element("li", f"{left} more are in results.json.")] if left > 0 else []
    return titled(title, bullets([*items, *more]))


def _printed(output: str) -> Html:
    return titled("Output of your code", element("pre", output, tabindex="0") if output.strip() else "")


_AHEAD_DEG: Final = 0.5
_NOT_READ: Final = "Not simulated, because no controller or expectation reads it"


def sightings(replay: Replay) -> Html:
    """Return the section on the sensors of a run; empty if they saw no obstacle and all of them were read."""
    items = [_obstacle(obstacle, replay) for obstacle in replay.obstacles]
    if replay.unread:
        names = ", ".join(one_line(name) for name in replay.unread)
        key = element("code", "trace: true")
        items.append(element("li", f"{_NOT_READ}: {names}. Add ", key, " to a sensor to see here what it measures."))
    return titled("What the sensors saw", bullets(items, "sightings"))


def first_seen(replay: Replay) -> dict[str, SightingData]:
    """Return name of a body -> its first sighting, for the bodies that the robot met."""
    return {replay.scene.bodies[obstacle.body].name: obstacle.seen[0] for obstacle in replay.obstacles if obstacle.seen}


def first_seen_words(seen: SightingData) -> str:
    """Return words such as "first seen by skirt (lidar) at 1.40 s"."""
    return f"first seen by {one_line(seen.sensor)} ({one_line(seen.kind)}) at {moment(seen.time)}"


def _obstacle(obstacle: ObstacleData, replay: Replay) -> Html:
    name = element("b", one_line(replay.scene.bodies[obstacle.body].name))
    if not obstacle.seen:
        parts: list[str] = [name, " was not seen by any lidar or contact sensor, in the readings that are kept"]
    else:
        first, *later = obstacle.seen
        parts = [name, " was first seen by ", *_sighting(first)]
        for number, sighting in enumerate(later):
            parts += [", then by " if number == 0 else ", ", *_sighting(sighting)]
        parts += [f"; {', '.join(map(_blind, obstacle.blind))} did not see it"] if obstacle.blind else []
    if obstacle.touched is not None:
        parts += ["; the robot touched it at ", value_link(obstacle.touched)]
        if obstacle.seen and obstacle.seen[0].time < obstacle.touched:
            # The difference of the times as they are shown.
            parts.append(f", {moment(round(obstacle.touched, 2) - round(obstacle.seen[0].time, 2))} later")
    return element("li", *parts, ".")


def _sighting(sighting: SightingData) -> list[str]:
    kept = "" if sighting.every == 1 else f", 1 of {sighting.every} readings looked at"
    words = [f"{one_line(sighting.sensor)} ({one_line(sighting.kind)}{kept}) at ", value_link(sighting.time)]
    if sighting.distance is not None:
        where = "" if sighting.angle is None else f" {direction(sighting.angle)}"
        words.append(f", {units.display(sighting.distance, 'm')} away{where}")
    return words


def direction(angle: float) -> str:
    """Return a direction in words; `angle` is in rad, counter-clockwise from straight ahead of a sensor."""
    degrees = math.degrees(angle)
    if abs(degrees) < _AHEAD_DEG:
        return "straight ahead"
    if abs(degrees) > 180 - _AHEAD_DEG:
        return "behind"
    return f"{abs(degrees):.0f} deg to the {'left' if degrees > 0 else 'right'}"


def _blind(lidar: BlindData) -> str:
    kept = "" if lidar.every == 1 else f", 1 of {lidar.every} readings looked at"
    return f"{one_line(lidar.sensor)} (lidar{kept})"
