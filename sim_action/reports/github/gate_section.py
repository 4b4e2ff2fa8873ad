"""The section of a gate in the job summary: what it claims and found, and the runs that did not pass."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from sim_action.reports import ReportOptions
from sim_action.reports.escaping import markdown_text
from sim_action.reports.formatting import moment
from sim_action.reports.gate_chances import chance_tables
from sim_action.reports.github.markdown import (
    code_of_link,
    folded,
    left_out_note,
    message_text,
    row,
    source_link,
    table,
)
from sim_action.reports.links import reason_time, replay_link
from sim_action.reports.scenario_groups import ScenarioGroup
from sim_action.reports.statuses import STATUS_DISPLAYS
from sim_action.results.outcome import Outcome

_MAX_RUNS: Final = 10
_MAX_WARNINGS: Final = 20


def gate_section(group: ScenarioGroup, options: ReportOptions) -> str:
    """Return the section of a gate, or of runs that another call judges, without the details of any run."""
    bad = group.not_passed
    rows = [_run(group, run, options) for run in bad[:_MAX_RUNS]]
    warnings = list(_warnings(group, options))
    parts = [
        f"### {group.display.icon} {markdown_text(group.name)}: {markdown_text(group.rate_text or group.gate_text)}",
        " · ".join(part for part in _subtitle(group, options) if part),
        *_claims(group, options),
        f"{markdown_text(group.not_passed_text)}; the worst first:" if bad else "",
        table(("Run", "Result", " Sim time"), rows) if rows else "",
        left_out_note(len(bad), _MAX_RUNS, "run"),
        "\n".join(warnings[:_MAX_WARNINGS]),
        left_out_note(len(warnings), _MAX_WARNINGS, "warning"),
        _chances(group),
    ]
    return "\n\n".join(part for part in parts if part)


def _subtitle(group: ScenarioGroup, options: ReportOptions) -> Iterator[str]:
    yield source_link(options, group.location)
    yield markdown_text(group.engines)
    if group.rate_text:
        yield markdown_text(group.gate_text)


def _claims(group: ScenarioGroup, options: ReportOptions) -> Iterator[str]:
    """Yield the reasons why the gate has no verdict, and a table of its claims."""
    if group.gate is None:
        if group.could_not_run:
            yield message_text(group.ending)
        return
    for failure in group.gate.failures:
        place = "" if failure.location is None else f"<br>\n{source_link(options, failure.location)}"
        yield f"**{message_text(failure.title)}**: {message_text(failure.message)}{place}"
    if group.gate.expectations:
        found = (
            row(
                STATUS_DISPLAYS[expected.status].icon,
                f"**{markdown_text(expected.name)}**<br>{source_link(options, expected.location)}",
                message_text(expected.verdict.message),
            )
            for expected in group.gate.expectations
        )
        yield table(("", "Claim", "Found"), found)


def _chances(group: ScenarioGroup) -> str:
    """Return the verdicts that robots of known rates get from the gate, folded."""
    if group.planned is None:
        return ""
    (told,) = chance_tables([group.planned])
    rows = (row(*map(markdown_text, each)) for each in told.rows)
    columns = ("A robot that is ... good", *(f" {rate}" for rate in told.columns))
    parts = [table(columns, rows) if told.rows else "", *map(markdown_text, told.remarks)]
    return folded("The chances of robots with known rates", "\n\n".join(part for part in parts if part))


def _run(group: ScenarioGroup, run: Outcome, options: ReportOptions) -> str:
    link = replay_link(run, options, reason_time(run))
    seen = f"<br>replay: {code_of_link(link)}" if link else ""
    return row(markdown_text(group.values(run)), f"{message_text(run.ending)}{seen}", moment(run.sim_time))


def _warnings(group: ScenarioGroup, options: ReportOptions) -> Iterator[str]:
    """Yield the entries of a list: each warning once for all runs."""
    icon = STATUS_DISPLAYS["warned"].icon
    for expected, run, runs in group.warned:
        seen = message_text(f"{expected.name}: {group.share_text(run, expected, runs)}")
        yield f"- {icon} {seen}<br>{source_link(options, expected.location)}"
    for warning, runs in group.warnings:
        yield f"- {icon} {message_text(group.warning_text(warning, runs))}<br>{source_link(options, warning.location)}"
