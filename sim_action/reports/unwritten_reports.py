"""The messages about reports that cannot be written, and the verdicts on standard output in their place."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import Final, TextIO

from sim_action.core.errors import ExitCode, InternalError
from sim_action.core.wording import escaped_line, log_line, system_reason
from sim_action.reports import ReportOptions
from sim_action.reports.escaping import log_text, one_line
from sim_action.reports.scenario_groups import grouped_scenarios
from sim_action.reports.statuses import STATUS_DISPLAYS
from sim_action.results.artifacts import REPORT_FILE
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import RESULTS_FILE, Results

_REQUIRED: Final = frozenset({"results", "junit", "outputs"})
"""The reports that other programs read; without one of them, a call never ends with exit code 0."""

_PRINTED: Final[Callable[[ReportOptions], Path | str]] = lambda _: "standard output"  # noqa: E731 - one entry of a table

_TARGETS: Final[Mapping[str, tuple[str, Callable[[ReportOptions], Path | str]]]] = MappingProxyType(
    {
        "results": ("results", lambda options: options.folder / RESULTS_FILE),
        "report": ("HTML report", lambda options: options.folder / REPORT_FILE),
        "junit": ("JUnit XML", lambda options: options.junit),
        "summary": ("summary", lambda options: options.environment["GITHUB_STEP_SUMMARY"]),
        "outputs": ("outputs", lambda options: options.environment["GITHUB_OUTPUT"]),
        "terminal": ("report for the terminal", _PRINTED),
        "annotations": ("annotations", _PRINTED),
    }
)
"""Name of a report -> its name in messages, and the function that returns its target."""


def complain_about(unwritten: Mapping[str, Exception], results: Results, options: ReportOptions) -> ExitCode:
    """Report on standard error why reports are missing, and return the exit code that follows from this.

    Print every verdict on standard output if a required report is missing.
    """
    codes: list[ExitCode] = []
    for name, error in unwritten.items():
        label, target = _TARGETS[name]
        message = f"the {label} cannot be written to {target(options)}"
        if not isinstance(error, (OSError, UnicodeError, MemoryError)):
            codes.append(ExitCode.INTERNAL)
            fault = InternalError.of(error)
            for line in fault.details.splitlines():
                _print(log_line(line), sys.stderr)
            _print(_complaint(f"{message}: {fault}", options.environment), sys.stderr)
        elif name in _REQUIRED:
            codes.append(ExitCode.FAILED)
            _print(_complaint(escaped_line(f"{message}: {system_reason(error)}"), options.environment), sys.stderr)
        else:
            _print(log_line(f"sim-action: warning: {message}: {system_reason(error)}"), sys.stderr)
    if not _REQUIRED.isdisjoint(unwritten):
        text = "\n".join(_verdicts(results))
        # Without standard output, the log of errors is the last place for the verdicts.
        _print(text, sys.stdout) or _print(text, sys.stderr)
    return ExitCode.of_command(codes)


def _complaint(message: str, environment: Mapping[str, str]) -> str:
    if environment.get("GITHUB_ACTIONS") == "true":
        # Without the files of this module, the line is better than nothing.
        with suppress(OSError, ImportError):
            from sim_action.reports.github.annotations import complaint

            return complaint(message, environment)
    return log_line(f"sim-action: {message}")


def _print(text: str, stream: TextIO) -> bool:
    """Print lines, and return False if that is impossible."""
    with suppress(OSError, ValueError):
        stream.write(log_text(text, stream.encoding or "utf-8") + "\n")
        stream.flush()
        return True
    return False


def _verdicts(results: Results) -> Iterator[str]:
    """Yield one line for each scenario and gate: the status, the name and, unless it passed, the first reason.

    A gate that passed has its rate instead.
    """
    if not results.outcomes:
        yield "there are no verdicts: no scenario was run"
    for group in grouped_scenarios(results.outcomes, results.gates):
        if group.is_part:
            yield log_line(f"{group.display.word}  {one_line(group.name)}  {one_line(group.ending)}")
    for outcome in results.verdicts:
        reason = one_line(_first_reason(outcome))
        parts = (STATUS_DISPLAYS[outcome.status].word, one_line(outcome.name), reason)
        yield log_line("  ".join(part for part in parts if part))


def _first_reason(outcome: Outcome) -> str:
    if outcome.failures:
        return f"{outcome.failures[0].title}: {outcome.failures[0].message}"
    if outcome.causes:
        return f"{outcome.causes[0].name}: {outcome.causes[0].verdict.message}"
    if outcome.statistics is not None and outcome.expectations:
        return outcome.expectations[0].verdict.message
    return "" if outcome.status == "passed" else " ".join(outcome.notes)
