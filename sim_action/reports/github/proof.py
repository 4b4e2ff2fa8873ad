"""The reports of `sim-action prove` on GitHub: the job summary, annotations, and the outputs of the step."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

from sim_action.core.errors import Location
from sim_action.core.files import append_whole
from sim_action.core.wording import counted, shortened
from sim_action.reports import ReportOptions
from sim_action.reports.escaping import markdown_block, markdown_text
from sim_action.reports.github.annotations import Annotation, print_annotations
from sim_action.reports.github.job_summary import MAX_BYTES
from sim_action.reports.github.markdown import code, fitting, folded, message_text, row, source_link, table
from sim_action.reports.github.step_outputs import append_outputs
from sim_action.reports.proof import by_suggestion, finding_text, headline, suggestion_title, survivor_text
from sim_action.reports.statuses import Level
from sim_action.results.artifacts import REPORT_FILE
from sim_action.results.proof import Finding, Proof, ProvenExpectation, ProvenScenario

_ICONS: Final[dict[Finding, str]] = {"notices": "✅", "checks nothing": "❌", "unknown": "❔"}
_MAX_NAME: Final = 100
# An upper bound for the size of the headline, the folds and the remark on what is not shown.
_FRAME: Final = 4_000


def write_proof_summary(proof: Proof, options: ReportOptions) -> None:
    """Append the findings to the file named by `GITHUB_STEP_SUMMARY`, if it is set. Raise OSError."""
    name = options.environment.get("GITHUB_STEP_SUMMARY")
    if not name:
        return
    file = Path(name)
    written = file.stat().st_size if file.exists() else 0
    append_whole(file, proof_summary(proof, options, MAX_BYTES - written).encode("utf-8", errors="replace"))


def proof_summary(proof: Proof, options: ReportOptions, most_bytes: int = MAX_BYTES) -> str:
    """Return the findings as Markdown in at most `most_bytes`; scenarios without a remark come last, and are folded."""
    room = most_bytes - _FRAME
    if room < 0:
        return ""
    ordered = sorted(proof.scenarios, key=lambda scenario: not _has_remark(scenario))
    sections = fitting((_section(scenario, options) for scenario in ordered), room)
    open_ones = sum(map(_has_remark, ordered[: len(sections)]))
    left = len(ordered) - len(sections)
    parts = [
        f"## {_title(proof)}",
        f"{markdown_text(headline(proof))}; {counted(proof.runs, 'run')} in {proof.wall_time:.0f} s",
        *sections[:open_ones],
        folded(f"Scenarios without a remark ({len(sections) - open_ones})", "\n\n".join(sections[open_ones:]))
        if len(sections) > open_ones
        else "",
        f"_{counted(left, 'more scenario')} not shown: the size of the summary is limited._" if left else "",
    ]
    return "\n\n".join(part for part in parts if part) + "\n\n"


def _title(proof: Proof) -> str:
    if proof.interrupted:
        return "🛑 Proof interrupted"
    if not proof.scenarios:
        return "⚠️ No scenarios were run"
    if proof.useless:
        return f"❌ {counted(proof.useless, 'expectation')} {'checks' if proof.useless == 1 else 'check'} nothing"
    if any(map(_has_remark, proof.scenarios)):
        return "⚠️ No expectation is known to check nothing"
    return "✅ Every expectation notices something"


def _has_remark(scenario: ProvenScenario) -> bool:
    return (
        not scenario.is_proven
        or any(each.finding != "notices" for each in scenario.expectations)
        or bool(scenario.survivors)
    )


def _section(scenario: ProvenScenario, options: ReportOptions) -> str:
    place = source_link(options, Location(scenario.file, scenario.line, None)) if scenario.file else ""
    parts = [f"### {markdown_text(shortened(scenario.name, _MAX_NAME))}", place]
    if not scenario.is_proven:
        where = "" if scenario.location is None else f"<br>{source_link(options, scenario.location)}"
        parts.append(f"not mutated: {message_text(scenario.reason)}{where}")
    if scenario.expectations:
        rows = (_row(expected, scenario, options) for expected in scenario.expectations)
        parts.append(table(("", "Expectation", "Finding"), rows))
    parts += _survivors(scenario)
    return "\n\n".join(part for part in parts if part)


def _row(expected: ProvenExpectation, scenario: ProvenScenario, options: ReportOptions) -> str:
    name = markdown_text(shortened(expected.name, _MAX_NAME))
    place = f"<br>{source_link(options, expected.location)}" if expected.finding == "checks nothing" else ""
    return row(_ICONS[expected.finding], name + place, message_text(finding_text(expected, scenario)))


def _survivors(scenario: ProvenScenario) -> Iterator[str]:
    """Yield each group of survivors, followed by the expectation to paste."""
    for suggestion, survivors in by_suggestion(scenario):
        yield "\n".join(f"- {code(each.name)}: {message_text(survivor_text(each))}" for each in survivors)
        yield suggestion_title(suggestion, survivors).capitalize()
        if suggestion:
            yield markdown_block(suggestion, "yaml")


def write_proof_annotations(proof: Proof, options: ReportOptions, *, strict: bool) -> None:
    """Print an annotation at each expectation that checks nothing, if this is GitHub Actions.

    They are warnings, and invalid scenarios are errors. `strict`: all are errors, and each unknown expectation and each
    scenario that is not mutated has one, too.
    """
    if options.environment.get("GITHUB_ACTIONS") != "true":
        return
    print_annotations(list(_annotations(proof, "error" if strict else "warning", strict=strict)), options)


def _annotations(proof: Proof, level: Level, *, strict: bool) -> Iterator[Annotation]:
    for scenario in proof.scenarios:
        for expected in scenario.unproven if strict else scenario.useless:
            message = f"{scenario.name}: {expected.name}: {finding_text(expected, scenario)}"
            yield Annotation(level, f"{expected.finding}: {expected.name}", message, expected.location)
        if scenario.is_refused or (strict and not scenario.is_proven):
            yield Annotation("error", f"not mutated: {scenario.name}", scenario.reason, scenario.location)


def write_proof_outputs(proof: Proof, options: ReportOptions) -> None:
    """Append the outputs to the file named by `GITHUB_OUTPUT`, if it is set. Raise OSError."""
    append_outputs(proof_outputs(proof, options), options.environment)


def proof_outputs(proof: Proof, options: ReportOptions) -> dict[str, str]:
    """Return name -> value of the outputs of the action `prove`."""
    return {
        "unproven": str(proof.useless),
        "survivors": str(proof.survivors),
        "not-mutated": str(sum(not scenario.is_proven for scenario in proof.scenarios)),
        "report-path": "" if "report" in options.silenced else str((options.folder / REPORT_FILE).absolute()),
    }
