"""The report of `sim-action prove` on a terminal, and its words, which other reports use, too."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import Final, TextIO

from sim_action.core.wording import counted, shortened
from sim_action.reports.console import open_console
from sim_action.reports.escaping import log_text
from sim_action.results.proof import Finding, MutantResult, Proof, ProvenExpectation, ProvenScenario

_SYMBOLS: Final[dict[Finding, str]] = {"notices": "✓", "checks nothing": "✗", "unknown": "·"}
_ASCII_SYMBOLS: Final[dict[Finding, str]] = {"notices": "+", "checks nothing": "x", "unknown": "-"}
_STYLES: Final[dict[Finding, str]] = {"notices": "green", "checks nothing": "bold red", "unknown": "dim"}
_MOST_NAMES: Final = 6
_MOST_SENSITIVITY: Final = 10.0
_MOST_TEXT: Final = 300

_Line = Sequence[tuple[str, str]]


def print_proof(proof: Proof, environment: Mapping[str, str], stream: TextIO | None = None) -> None:
    """Print the findings on a stream (default: standard output), and at last the counts."""
    with open_console(stream or sys.stdout, environment) as shown:
        is_full = log_text("✗·✓", shown.encoding) == "✗·✓"
        for line in _lines(proof, _SYMBOLS if is_full else _ASCII_SYMBOLS):
            shown.print(*((log_text(text, shown.encoding).replace("\n", " "), style) for text, style in line))


def _lines(proof: Proof, symbols: Mapping[Finding, str]) -> Iterator[_Line]:
    for scenario in proof.scenarios:
        yield from _of_scenario(scenario, symbols)
        yield ()
    yield [(headline(proof), "bold red" if proof.useless else "green" if proof.all_notice else "yellow")]


def headline(proof: Proof) -> str:
    """Return the counts, such as "1 expectation checks nothing, 5 notice something; 2 scenarios do not pass"."""
    every = [each for scenario in proof.scenarios for each in scenario.expectations]
    notices = sum(each.finding == "notices" for each in every)
    unknown = sum(each.finding == "unknown" for each in every)
    told = [f"{counted(proof.useless, 'expectation')} {'checks' if proof.useless == 1 else 'check'} nothing"]
    told += [f"{notices} {'notices' if notices == 1 else 'notice'} something"]
    told += [f"{unknown} unknown"] if unknown else []
    told += [f"{counted(proof.survivors, 'other motion')} unnoticed"] if proof.survivors else []
    unproven = sum(not scenario.is_proven for scenario in proof.scenarios)
    left = sum(scenario.unfinished for scenario in proof.scenarios)
    start = (
        f"interrupted before {counted(left, 'mutant')} had ended: " if left else "interrupted: "
    ) * proof.interrupted
    return start + ", ".join(told) + (f"; {counted(unproven, 'scenario')} not mutated" if unproven else "")


def _of_scenario(scenario: ProvenScenario, symbols: Mapping[Finding, str]) -> Iterator[_Line]:
    place = f"  {scenario.file}" + (f":{scenario.line}" if scenario.line is not None else "")
    yield [(scenario.name, "bold"), (place, "dim")]
    if not scenario.is_proven:
        yield [("  not mutated: ", "yellow"), (scenario.reason, "")]
        if scenario.location is not None and scenario.location.line is not None:
            yield [("      ", ""), (str(scenario.location), "cyan")]
    else:
        yield from _of_expectations(scenario, symbols)
        yield from _of_mutants(scenario)


def _of_expectations(scenario: ProvenScenario, symbols: Mapping[Finding, str]) -> Iterator[_Line]:
    for expected in scenario.expectations:
        look = _STYLES[expected.finding]
        yield [
            (f"  {symbols[expected.finding]} ", look),
            (expected.name, ""),
            (f": {finding_text(expected, scenario)}", ""),
        ]
        if expected.finding == "checks nothing":
            yield [("      ", ""), (str(expected.location), "cyan")]


def _of_mutants(scenario: ProvenScenario) -> Iterator[_Line]:
    for suggestion, survivors in by_suggestion(scenario):
        yield from _of_survivors(suggestion, survivors)
    for words, mutants in (
        ("unnoticed, with little other motion", [each for each in scenario.with_status("survived") if not each.change]),
        ("no effect", scenario.with_status("no effect")),
    ):
        if mutants:
            yield [(f"  {words}: {', '.join(each.name for each in mutants)}", "dim")]
    for mutant in scenario.with_status("could not run"):
        yield [(f"  could not run: {mutant.name}: {shortened(mutant.reason, _MOST_TEXT)}", "dim")]
    if scenario.left_out:
        yield [(f"  {counted(scenario.left_out, 'mutant')} left out", "yellow")]
    if scenario.unfinished:
        yield [(f"  {counted(scenario.unfinished, 'mutant')} had not ended when the call was interrupted", "yellow")]


def by_suggestion(scenario: ProvenScenario) -> list[tuple[str, list[MutantResult]]]:
    """Return the survivors of a scenario by the expectation that would have noticed them; empty if there is none."""
    found: dict[str, list[MutantResult]] = {}
    for survivor in scenario.survivors:
        found.setdefault(survivor.suggestion, []).append(survivor)
    return list(found.items())


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
    lost = f"; not exercised in: {_names(expected.not_exercised)}" if expected.not_exercised else ""
    near = "" if expected.sensitivity is None else f"; {_share(expected.sensitivity)} from its limit"
    if expected.finding == "notices":
        return f"notices {len(expected.noticed)} of {expected.changed}: {_names(expected.noticed)}{lost}{near}"
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


def _names(names: Sequence[str]) -> str:
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return ", ".join(names[:_MOST_NAMES]) + more


def _of_survivors(suggestion: str, survivors: Sequence[MutantResult]) -> Iterator[_Line]:
    """Yield the mutants that one expectation would have noticed, and then this expectation; or those without one."""
    for survivor in survivors:
        yield [("  ! ", "yellow"), (survivor.name, ""), (f": {survivor_text(survivor)}", "")]
    yield [(f"      {suggestion_title(suggestion, survivors)}", "dim")]
    for line in suggestion.splitlines():
        yield [("        ", ""), (line, "cyan")]
