"""The report of `sim-action prove`: its words, a terminal, and GitHub with job summary, annotations and outputs."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import Final, TextIO

from sim_action.core.errors import Location
from sim_action.core.wording import counted, first_of, shortened
from sim_action.reports import ReportOptions
from sim_action.reports.display import Console, Level, Line, open_console
from sim_action.reports.escaping import markdown_block, markdown_text
from sim_action.reports.github import markdown
from sim_action.reports.github.annotations import Annotation, print_annotations
from sim_action.reports.github.job_summary import MAX_BYTES, append_summary
from sim_action.reports.github.step_outputs import append_outputs
from sim_action.reports.table import Row, Table
from sim_action.results.artifacts import REPORT_FILE
from sim_action.results.outcome import DisplayStatus
from sim_action.results.proof import Finding, MutantResult, Proof, ProvenExpectation, ProvenScenario

_STATUSES: Final[dict[Finding, DisplayStatus]] = {
    "notices": "passed",
    "checks nothing": "failed",
    "unknown": "not_exercised",
}
_MOST_NAMES: Final = 6
_MOST_SENSITIVITY: Final = 10.0
_MOST_TEXT: Final = 300


def print_proof(proof: Proof, environment: Mapping[str, str], stream: TextIO | None = None) -> None:
    """Print the findings on a stream (default: standard output), and at last the counts."""
    with open_console(stream or sys.stdout, environment) as shown:
        for scenario in proof.scenarios:
            for line in _of_scenario(scenario, shown):
                shown.print(*line)
            shown.print()
        shown.print((headline(proof), "bold red" if proof.useless else "green" if proof.all_notice else "yellow"))


def headline(proof: Proof) -> str:
    """Return the counts, such as "1 expectation checks nothing, 5 notice something; 2 scenarios do not pass"."""
    every = [expectation for scenario in proof.scenarios for expectation in scenario.expectations]
    notices = sum(expectation.finding == "notices" for expectation in every)
    unknown = sum(expectation.finding == "unknown" for expectation in every)
    parts = [f"{counted(proof.useless, 'expectation')} {'checks' if proof.useless == 1 else 'check'} nothing"]
    parts += [f"{notices} {'notices' if notices == 1 else 'notice'} something"]
    parts += [f"{unknown} unknown"] if unknown else []
    parts += [f"{counted(proof.survivors, 'other motion')} unnoticed"] if proof.survivors else []
    unproven = sum(not scenario.is_proven for scenario in proof.scenarios)
    left = sum(scenario.unfinished for scenario in proof.scenarios)
    start = (
        f"interrupted before {counted(left, 'mutant')} had ended: " if left else "interrupted: "
    ) * proof.interrupted
    return start + ", ".join(parts) + (f"; {counted(unproven, 'scenario')} not mutated" if unproven else "")


def _of_scenario(scenario: ProvenScenario, shown: Console) -> Iterator[Line]:
    place = f"  {scenario.file}" + (f":{scenario.line}" if scenario.line is not None else "")
    yield [(scenario.name, "bold"), (place, "dim")]
    if not scenario.is_proven:
        yield [("  not mutated: ", "yellow"), (scenario.reason, "")]
        if scenario.location is not None and scenario.location.line is not None:
            yield [("      ", ""), (str(scenario.location), "cyan")]
        return
    yield from expectation_table(scenario).lines(shown, "  ")
    for suggestion, survivors in by_suggestion(scenario):
        rows = tuple(Row("warned", survivor.name, survivor_text(survivor)) for survivor in survivors)
        yield from Table("Mutant", rows).lines(shown, "  ")
        yield [(f"      {suggestion_title(suggestion, survivors)}", "dim")]
        yield from ([("        ", ""), (line, "cyan")] for line in suggestion.splitlines())
    yield from ([(f"  {words}: {names}", "dim")] for words, names in other_mutants(scenario) if words != "noticed")


def expectation_table(scenario: ProvenScenario) -> Table:
    """Return the findings on the expectations of a scenario."""
    rows = (
        Row(
            _STATUSES[expected.finding],
            expected.name,
            finding_text(expected, scenario),
            location=expected.location,
            stands_out=expected.finding == "checks nothing",
        )
        for expected in scenario.expectations
    )
    return Table("Expectation", tuple(rows), message="Finding")


def other_mutants(scenario: ProvenScenario) -> Iterator[tuple[str, str]]:
    """Yield the mutants without a remark: they were noticed, changed little, did nothing or could not run."""
    groups = {
        "noticed": scenario.with_status("noticed"),
        "unnoticed, with little other motion": [
            mutant for mutant in scenario.with_status("survived") if mutant.change is None
        ],
        "no effect": scenario.with_status("no effect"),
    }
    yield from ((words, ", ".join(mutant.name for mutant in mutants)) for words, mutants in groups.items() if mutants)
    for mutant in scenario.with_status("could not run"):
        yield "could not run", f"{mutant.name}: {shortened(mutant.reason, _MOST_TEXT)}"
    counts = {"left out": scenario.left_out, "not ended": scenario.unfinished}
    yield from ((words, counted(count, "mutant")) for words, count in counts.items() if count)


def by_suggestion(scenario: ProvenScenario) -> list[tuple[str, list[MutantResult]]]:
    """Return the survivors of a scenario by the expectation that would have noticed them; empty if there is none."""
    survivors_by_suggestion: dict[str, list[MutantResult]] = {}
    for survivor in scenario.survivors:
        survivors_by_suggestion.setdefault(survivor.suggestion, []).append(survivor)
    return list(survivors_by_suggestion.items())


def survivor_text(survivor: MutantResult) -> str:
    """Return a mutant that survived in words: its fault, and the other motion that nothing noticed."""
    changed = survivor.change.text if survivor.change else ""
    warned = survivor.noticed_by or survivor.not_exercised
    return f"{survivor.words}: {changed}, and {'the scenario passed with a warning' if warned else 'nothing failed'}"


def suggestion_title(suggestion: str, survivors: Sequence[MutantResult]) -> str:
    """Return the words before the expectation that would have noticed some survivors, or that there is none."""
    them = "it" if len(survivors) == 1 else "them"
    if not suggestion:
        return f"no expectation was found that would have noticed {them}"
    return f"this expectation would have noticed {them}:"


def finding_text(expected: ProvenExpectation, scenario: ProvenScenario) -> str:
    """Return the finding on an expectation in words."""
    lost = f"; not exercised in: {first_of(expected.not_exercised, _MOST_NAMES)}" if expected.not_exercised else ""
    near = "" if expected.sensitivity is None else f"; {_share(expected.sensitivity)} from its limit"
    if expected.finding == "notices":
        noticed = f"{len(expected.noticed)} of {expected.changed}: {first_of(expected.noticed, _MOST_NAMES)}"
        return f"notices {noticed}{lost}{near}"
    if expected.finding == "checks nothing":
        others = f", {len(expected.missed)} of them noticed by others" if expected.missed else ""
        return f"checks nothing here: {counted(expected.changed, 'mutant')} changed the run{others}{lost}{near}"
    return f"unknown: {_unknown_reason(expected, scenario)}{lost}"


def _unknown_reason(expected: ProvenExpectation, scenario: ProvenScenario) -> str:
    if not expected.passed:
        return "it did not pass without a mutant either"
    seen = f"it noticed none of {counted(expected.changed, 'mutant')} that changed the run"
    if not expected.changed:
        seen = f"no {'other ' if expected.not_exercised else ''}mutant changed the run"
    if left := scenario.left_out:
        seen += f"; {counted(left, 'mutant')} {'was' if left == 1 else 'were'} left out"
    return seen + (f"; {counted(scenario.unfinished, 'mutant')} had not ended" if scenario.unfinished else "")


def _share(sensitivity: float) -> str:
    return f"{sensitivity:.0%}" if sensitivity <= _MOST_SENSITIVITY else f"more than {_MOST_SENSITIVITY:.0%}"


_MAX_NAME: Final = 100
_FRAME: Final = 4_000  # an upper bound for the size of the headline, the folds and the remark on omitted parts


def write_proof_summary(proof: Proof, options: ReportOptions) -> None:
    """Append the findings to the file named by `GITHUB_STEP_SUMMARY`, if it is set. Raise OSError."""
    append_summary(lambda most_bytes: proof_summary(proof, options, most_bytes), options.environment)


def proof_summary(proof: Proof, options: ReportOptions, most_bytes: int = MAX_BYTES) -> str:
    """Return the findings as Markdown in at most `most_bytes`; scenarios without a remark come last, and are folded."""
    room = most_bytes - _FRAME
    if room < 0:
        return ""
    ordered = sorted(proof.scenarios, key=lambda scenario: not _has_remark(scenario))
    sections = markdown.fitting((_section(scenario, options) for scenario in ordered), room)
    open_ones = sum(map(_has_remark, ordered[: len(sections)]))
    left = len(ordered) - len(sections)
    parts = [
        f"## {_summary_title(proof)}",
        f"{markdown_text(headline(proof))}; {counted(proof.runs, 'run')} in {proof.wall_time:.0f} s",
        *sections[:open_ones],
        markdown.folded(f"Scenarios without a remark ({len(sections) - open_ones})", "\n\n".join(sections[open_ones:]))
        if len(sections) > open_ones
        else "",
        f"_{counted(left, 'more scenario')} not shown: the size of the summary is limited._" if left else "",
    ]
    return markdown.paragraphs(*parts) + "\n\n"


def _summary_title(proof: Proof) -> str:
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
        or any(expectation.finding != "notices" for expectation in scenario.expectations)
        or bool(scenario.survivors)
    )


def _section(scenario: ProvenScenario, options: ReportOptions) -> str:
    place = markdown.source_link(options, Location(scenario.file, scenario.line, None)) if scenario.file else ""
    parts = [f"### {markdown_text(shortened(scenario.name, _MAX_NAME))}", place]
    if not scenario.is_proven:
        where = "" if scenario.location is None else f"<br>{markdown.source_link(options, scenario.location)}"
        parts.append(f"not mutated: {markdown.message_text(scenario.reason)}{where}")
    parts.append(markdown.markdown_table(expectation_table(scenario), options))
    parts += _survivors(scenario)
    return markdown.paragraphs(*parts)


def _survivors(scenario: ProvenScenario) -> Iterator[str]:
    """Yield each group of survivors, followed by the expectation to paste."""
    for suggestion, survivors in by_suggestion(scenario):
        yield "\n".join(
            f"- {markdown.code(survivor.name)}: {markdown.message_text(survivor_text(survivor))}"
            for survivor in survivors
        )
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
