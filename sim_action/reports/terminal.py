"""What a person reads after `sim-action run`; the worst stands last, right above the prompt."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final, TextIO

from rich.console import Console
from rich.text import Text

from sim_action.core.errors import ExitCode
from sim_action.reports import ReportOptions
from sim_action.reports.console import console
from sim_action.reports.escaping import log_text, plain_text
from sim_action.reports.groups import WORST_FIRST, Group, groups
from sim_action.reports.paths import stored_trace
from sim_action.reports.reproduction import REPORT_FILE
from sim_action.reports.wording import Mood, counts, factor, made_with, measurements, mood, own_output, repeated, share
from sim_action.results.file import RESULTS_FILE, Results
from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome

_SYMBOLS: Final[dict[Mood, str]] = {
    "passed": "✓",
    "skipped": "-",
    "warned": "!",
    "failed": "✗",
    "flaky": "≠",
    "error": "✗",
}
_ASCII_SYMBOLS: Final[dict[Mood, str]] = {
    "passed": "+",
    "skipped": "-",
    "warned": "!",
    "failed": "x",
    "flaky": "?",
    "error": "x",
}
_UNHAPPY: Final[tuple[Mood, ...]] = ("failed", "flaky", "error")
_STYLES: Final[dict[Mood, str]] = {
    "passed": "green",
    "skipped": "dim",
    "warned": "yellow",
    "failed": "bold red",
    "flaky": "bold red",
    "error": "bold red",
}
_MOODS: Final = tuple(reversed(WORST_FIRST))
_MOST_VARIATIONS: Final = 20


def print_results(results: Results, options: ReportOptions, stream: TextIO | None = None) -> None:
    """Prints to a stream, standard output unless another is given."""
    stream = stream or sys.stdout
    with console(stream, options.environment) as shown:
        printer = _Printer(shown, options)
        for group in sorted(groups(results.outcomes), key=lambda group: _MOODS.index(group.mood)):
            if options.verbosity != "quiet" or group.mood in _UNHAPPY:
                printer.group(group)
        printer.closing(results)


class _Printer:
    """Lines on a console; every text goes through `_line`, as text and never as markup."""

    def __init__(self, console: Console, options: ReportOptions) -> None:
        self._console = console
        self._options = options
        self._verbosity = options.verbosity
        self._encoding = console.encoding
        shows_symbols = log_text("✓✗≠│", self._encoding) == "✓✗≠│"
        self._symbols = _SYMBOLS if shows_symbols else _ASCII_SYMBOLS
        self._bar = "│" if shows_symbols else "|"
        self._margin = ""

    def group(self, group: Group) -> None:
        """One scenario, and an empty line; of its variations, those that did not pass."""
        if group.varies:
            worst = f"; worst: {group.worst_told}" if group.mood != "skipped" else ""
            self._heading(group.mood, group.name, f"  {group.location}", f"  {group.passed}{worst}")
            self._margin = "  "
            self._variations(group)
            self._margin = ""
        else:
            file = f"  {group.location}" if group.location else ""
            self._heading(group.mood, group.name, file, _after(repeated(group.worst)))
            self._outcome(group.worst)
        self._line()

    def _heading(self, look: Mood, name: str, file: str, rest: str = "") -> None:
        self._line("", (f"{self._symbols[look]} ", _STYLES[look]), (name, "bold"), (file, "dim"), (rest, ""))

    def _variations(self, group: Group) -> None:
        verbose = self._verbosity == "verbose"
        shown = [outcome for outcome in group.outcomes if verbose or mood(outcome) not in ("passed", "skipped")]
        most = len(shown) if verbose else _MOST_VARIATIONS
        for outcome in shown[:most]:
            self._heading(mood(outcome), outcome.name, "", _after(repeated(outcome)))
            self._outcome(outcome)
        if len(shown) > most:
            self._line("", (f"{len(shown) - most} more, see {RESULTS_FILE}", "dim"))

    def _outcome(self, outcome: Outcome) -> None:
        """What there is to say of one run."""
        if outcome.status == "skipped":
            self._line("  ", (" ".join(outcome.notes), "dim"))
            return
        for expected in outcome.causes_first:
            if self._verbosity != "quiet" or expected.failed:
                self._expectation(expected)
        for failure in outcome.failures:
            self._failure(failure)
        if self._verbosity == "verbose":
            self._run_details(outcome)

    def closing(self, results: Results) -> None:
        """The counts; but when quiet, where everything is, too."""
        moods = {mood(outcome) for outcome in results.outcomes}
        of_nothing: Mood = "passed" if results.exit_code is ExitCode.PASSED else "error"
        worst = max(moods, key=_MOODS.index, default=of_nothing)
        fast = f" ({factor(results.real_time_factor)})" if results.real_time_factor else ""
        part = f"; {share(results.shard)}" if results.shard else ""
        self._line("", (counts(results), _STYLES[worst]), (f" in {results.wall_time:.1f} s{fast}{part}", ""))
        if self._verbosity != "quiet":
            for name, path in _files(results, self._options):
                self._line("", (f"{name:<7} {path}", "dim"))

    def _expectation(self, expected: ExpectationOutcome) -> None:
        verdict = expected.verdict
        look: Mood = "passed" if verdict.passed else "warned" if expected.warned else "failed"
        self._line("  ", (f"{self._symbols[look]} ", _STYLES[look]), (expected.name, ""), (f": {verdict.message}", ""))
        measured = measurements(verdict)
        if measured and (not verdict.passed or self._verbosity == "verbose"):
            self._line("      ", (measured, "dim"))
        if not verdict.passed:
            self._line("      ", (str(expected.location), "cyan"))

    def _failure(self, failure: Failure) -> None:
        self._line("  ", (failure.title, "bold red"), (f": {failure.message}", ""))
        if failure.location is not None:
            self._line("      ", (str(failure.location), "cyan"))
        if failure.details:
            self._block("last words", failure.details)

    def _run_details(self, outcome: Outcome) -> None:
        ran = {
            "end": outcome.end,
            "speed": factor(outcome.real_time_factor),
            "engine": outcome.engine,
            **made_with(outcome.provenance),
            "seed": outcome.seed,
            "digest": outcome.digest,
            "trace": stored_trace(outcome, self._options.folder),
        }
        for name, value in ran.items():
            if value not in (None, ""):
                self._line("  ", (f"{name:<7} {value}", "dim"))
        for note in outcome.notes:
            self._line("  ", (f"note    {note}", "dim"))
        for diagnostic in outcome.diagnostics:
            self._line("  ", (f"{diagnostic.level:<7} {diagnostic.message}", "dim"))
        if output := own_output(outcome):
            self._block("output", output)

    def _block(self, title: str, text: str) -> None:
        """Text of many lines, behind a bar: none of them begins where a log looks for commands."""
        self._line("    ", (f"{title}:", "dim"))
        for line in plain_text(text).strip("\n").split("\n"):
            self._line("    ", (f"{self._bar} {line}", "dim"))

    def _line(self, indent: str = "", *parts: tuple[str, str]) -> None:
        """One line, made of parts with their styles."""
        shown = ((log_text(text, self._encoding).replace("\n", " "), style) for text, style in parts)
        # Wrapped by the terminal, not by us: paths stay whole for those who click or copy them.
        self._console.print(Text.assemble(self._margin if parts else "", indent, *shown), soft_wrap=True)


def _after(text: str) -> str:
    return f"  {text}" if text else ""


def _files(results: Results, options: ReportOptions) -> Iterator[tuple[str, Path]]:
    """What is where, for those who want more."""
    if "report" not in options.silenced:
        yield "report", options.folder / REPORT_FILE
    yield "results", options.folder / RESULTS_FILE
    yield "junit", options.junit
    traces = (stored_trace(outcome, options.folder) for outcome in results.outcomes)
    for folder in dict.fromkeys(trace.parent for trace in traces if trace is not None):
        yield "traces", folder
    recordings = (options.folder / name for outcome in results.outcomes for name in outcome.recordings)
    for folder in dict.fromkeys(recording.parent for recording in recordings):
        yield "records", folder
