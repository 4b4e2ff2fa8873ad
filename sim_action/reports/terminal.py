"""The report on the terminal after `sim-action run`; the worst scenario comes last, right above the prompt."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final, TextIO

from sim_action.core.errors import ExitCode
from sim_action.reports import ReportOptions, formatting
from sim_action.reports.display import STATUS_DISPLAYS, Console, RowStatus, StatusDisplay, display_of, open_console
from sim_action.reports.escaping import plain_text
from sim_action.reports.links import stored_trace
from sim_action.reports.scenario_groups import ScenarioGroup, grouped_scenarios
from sim_action.reports.table import NUMBERS, Row, Table, expectation_rows
from sim_action.results.artifacts import REPORT_FILE
from sim_action.results.outcome import WORST_FIRST, DisplayStatus, Failure, Outcome
from sim_action.results.results_json import RESULTS_FILE, Results
from sim_action.scenario.variations.gate import PlannedGate

_BEST_FIRST: Final = tuple(reversed(WORST_FIRST))
_MAX_MODEL_NOTES: Final = 6
_MAX_VARIATIONS: Final = 20
_MAX_RUNS_OF_GATE: Final = 5


def print_results(results: Results, options: ReportOptions, stream: TextIO | None = None) -> None:
    """Print the results to a stream (default: standard output), the worst last."""
    stream = stream or sys.stdout
    if options.verbosity == "json":
        # In UTF-8, regardless of the encoding of the terminal.
        stream.flush()
        stream.buffer.writelines(results.parts())
        stream.buffer.flush()
        return
    with open_console(stream, options.environment) as shown:
        printer = _Printer(shown, options)
        printer.scenarios(results.outcomes, results.gates)
        printer.closing(results)


def print_outcomes(outcomes: Iterable[Outcome], options: ReportOptions, shown: Console) -> None:
    """Print some outcomes as in the report, without the counts and the files of the call."""
    _Printer(shown, options).scenarios(outcomes)


class _Printer:
    """Print lines on a console."""

    def __init__(self, console: Console, options: ReportOptions) -> None:
        self._console = console
        self._options = options
        self._verbosity = options.verbosity
        self._bar = "│" if console.can_show("│") else "|"
        self._margin = ""
        self._announced = set[str]()

    def scenarios(self, outcomes: Iterable[Outcome], gates: Iterable[PlannedGate] = ()) -> None:
        """Print the scenarios and gates, the worst last."""
        for group in sorted(grouped_scenarios(outcomes, gates), key=lambda group: _BEST_FIRST.index(group.status)):
            if self._verbosity != "quiet" or STATUS_DISPLAYS[group.status].level == "error":
                self.group(group)

    def group(self, group: ScenarioGroup) -> None:
        """Print one scenario and an empty line; variations that passed are only counted, unless verbose."""
        file = "".join(f"  {part}" for part in (group.location, group.engines) if part)
        if group.is_gate:
            self._gate(group, file)
        elif group.varies:
            self._heading(STATUS_DISPLAYS[group.status], group.name, file, _after(group.variations_text))
            self._variations(group)
            self._warnings(group)
        else:
            self._heading(STATUS_DISPLAYS[group.status], group.name, file, _after(formatting.repeats_text(group.worst)))
            self._outcome(group.worst)
            self._warnings(group)
        self._model_notes(group)
        self._line()

    def _heading(self, look: StatusDisplay, name: str, file: str, rest: str = "") -> None:
        self._line("", self._console.mark(look), (name, "bold"), (file, "dim"), (rest, ""))

    def _table(self, rows: Sequence[Row]) -> None:
        is_verbose = self._verbosity == "verbose"
        for line in Table("", tuple(rows), NUMBERS).lines(self._console, f"{self._margin}  ", verbose=is_verbose):
            self._console.print(*line)

    def _gate(self, group: ScenarioGroup, file: str) -> None:
        """Print a gate: what it claims and found, and the runs that did not pass; all runs if verbose."""
        self._heading(display_of(group.row_status), group.name, file, _after(group.gate_text))
        for stopped in group.could_not_run[:1] if group.is_part else ():
            self._outcome(stopped)
        if group.gate is not None:
            self._outcome(group.gate)
        if self._verbosity == "verbose":
            self._variations(group)
        elif self._verbosity != "quiet":
            # Without a colour: a run of a gate does not count by itself.
            bad = group.not_passed
            if bad:
                self._line("  ", (f"{group.not_passed_text}; the worst first:", "dim"))
            for run in bad[:_MAX_RUNS_OF_GATE]:
                self._line("    ", (f"{group.values(run)} {run.ending}", "dim"))
            if len(bad) > _MAX_RUNS_OF_GATE:
                more = f"{len(bad) - _MAX_RUNS_OF_GATE} more: --verbose shows all runs, {RESULTS_FILE} has them"
                self._line("    ", (more, "dim"))
            self._table([Row("warned", expected.name, share) for expected, share in group.warned])
        self._warnings(group)

    def _variations(self, group: ScenarioGroup) -> None:
        self._margin = "  "
        verbose = self._verbosity == "verbose"
        shown = [
            outcome
            for outcome in group.outcomes
            if verbose
            or outcome.status not in ("passed", "skipped")
            or any(expected.warned for expected in outcome.expectations)
        ]
        most = len(shown) if verbose else _MAX_VARIATIONS
        for outcome in shown[:most]:
            look = STATUS_DISPLAYS[outcome.display_status]
            self._heading(look, outcome.name, "", _after(formatting.repeats_text(outcome)))
            self._outcome(outcome)
        if len(shown) > most:
            self._line("", (f"{len(shown) - most} more variations: see {RESULTS_FILE}", "dim"))
        self._margin = ""

    def _outcome(self, outcome: Outcome) -> None:
        """Print the expectations and failures of one run."""
        if outcome.status == "skipped":
            self._line("  ", (" ".join(outcome.notes), "dim"))
            return
        is_quiet = self._verbosity == "quiet"
        shown = [expected for expected in outcome.causes_first if not is_quiet or expected in outcome.causes]
        self._table(expectation_rows(outcome, shown))
        if not is_quiet:
            self._table(
                [
                    Row("information", f"{bar} {message}") if bar else Row("information", measurement.name, message)
                    for measurement in outcome.measurements
                    for bar, message in [formatting.measured_text(measurement)]
                ]
            )
        for failure in outcome.failures:
            self._failure(failure)
        if not is_quiet and (happened := formatting.timeline_text(outcome)):
            self._line("  ", (f"timeline: {happened}", "dim"))
        if self._verbosity == "verbose" and outcome.statistics is None:
            self._run_details(outcome)

    def _warnings(self, group: ScenarioGroup) -> None:
        """Print the warnings of the audit, each once for all variations."""
        strict = any(outcome.strict for outcome in group.outcomes)
        if self._verbosity == "quiet" and not strict:
            return
        texts = ((group.warning_text(*pair), pair[0].location) for pair in group.warnings)
        status: RowStatus = "failed" if strict else "warned"
        self._table([Row(status, text, location=place, stands_out=True) for text, place in texts])

    def _model_notes(self, group: ScenarioGroup) -> None:
        """Print the notes on the robot model, each once for all scenarios."""
        if self._verbosity == "quiet":
            return
        notes = dict.fromkeys(note for outcome in group.outcomes for note in outcome.model_notes)
        new = [note for note in notes if note not in self._announced]
        self._announced.update(new)
        most = len(new) if self._verbosity == "verbose" else _MAX_MODEL_NOTES
        for note in new[:most]:
            self._line("  ", ("note: ", "dim"), (note, "dim"))
        if len(new) > most:
            self._line("  ", (f"{len(new) - most} more notes on the model: --verbose shows them", "dim"))

    def closing(self, results: Results) -> None:
        """Print the counts and, unless quiet, the paths of all files."""
        statuses = {outcome.display_status for outcome in results.verdicts}
        of_nothing: DisplayStatus = "passed" if results.exit_code is ExitCode.PASSED else "error"
        worst = max(statuses, key=_BEST_FIRST.index, default=of_nothing)
        taken_over = self._options.taken_over
        part = f"; {formatting.shard_text(results.shard)}" if results.shard else ""
        took = f" in {formatting.took_text(results, taken_over)}{part}"
        self._line("", (formatting.counts_text(results), STATUS_DISPLAYS[worst].style), (took, ""))
        if taken_over is not None:
            self._line("", (formatting.taken_over_text(taken_over, results), ""))
        if self._verbosity != "quiet":
            for name, path in _files(results, self._options):
                self._line("", (f"{name:<10} {path}", "dim"))

    def _failure(self, failure: Failure) -> None:
        self._line("  ", (failure.title, "bold red"), (f": {failure.message}", ""))
        if failure.location is not None:
            self._line("      ", (str(failure.location), "cyan"))
        if failure.details:
            self._block("details", failure.details)

    def _run_details(self, outcome: Outcome) -> None:
        trace = stored_trace(outcome, self._options.folder)
        facts = formatting.run_facts(outcome) | ({} if trace is None else {"trace": str(trace)})
        notes = [("note", note) for note in outcome.notes]
        notes += [(diagnostic.level, diagnostic.message) for diagnostic in outcome.diagnostics]
        for name, value in (*facts.items(), *notes):
            self._line("  ", (f"{name:<10} {value}", "dim"))
        if output := formatting.user_output(outcome):
            self._block("output", output)

    def _block(self, title: str, text: str) -> None:
        self._line("    ", (f"{title}:", "dim"))
        for line in plain_text(text).strip("\n").split("\n"):
            self._line("    ", (f"{self._bar} {line}", "dim"))

    def _line(self, indent: str = "", *parts: tuple[str, str]) -> None:
        self._console.print((f"{self._margin if parts else ''}{indent}", ""), *parts)


def _after(text: str) -> str:
    return f"  {text}" if text else ""


def _files(results: Results, options: ReportOptions) -> Iterator[tuple[str, Path]]:
    """Yield the label and path of each file that was written."""
    if "report" not in options.silenced:
        yield "report", options.folder / REPORT_FILE
    if "results" not in options.silenced:
        yield "results", options.folder / RESULTS_FILE
    if "junit" not in options.silenced:
        yield "junit", options.junit
    traces = (stored_trace(outcome, options.folder) for outcome in results.outcomes)
    for folder in dict.fromkeys(trace.parent for trace in traces if trace is not None):
        yield "traces", folder
    recordings = (options.folder / name for outcome in results.outcomes for name in outcome.recordings)
    for folder in dict.fromkeys(recording.parent for recording in recordings):
        yield "recordings", folder
