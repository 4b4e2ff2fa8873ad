"""The results that `sim_action.run` returns."""

from __future__ import annotations

import io
import os
import shutil
import tempfile
import weakref
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, SupportsIndex, overload

from sim_action.core.errors import ExitCode, Location, UsageError
from sim_action.core.wording import shortened, system_reason
from sim_action.reports import ReportOptions
from sim_action.reports.display import Console
from sim_action.reports.html.notebook import HtmlConsole, outcome_page, player_frame, report_frame
from sim_action.reports.terminal import print_outcomes
from sim_action.results import results_json
from sim_action.results.artifacts import REPORT_FILE
from sim_action.results.outcome import ExpectationOutcome, Failure, Status
from sim_action.results.outcome import Outcome as RecordedOutcome
from sim_action.results.output_folder import JUNIT_FILE
from sim_action.state.trace import Trace
from sim_action.state.trace_storage import load_trace

if TYPE_CHECKING:
    import pandas as pd

    from sim_action.results.outcome import GateStatistics

_MAX_EMBEDDED_BYTES: Final = 8_000_000
_MAX_CAUSE: Final = 150  # pytest cuts longer reprs


class RunFolder:
    """The folder of a run.

    Attributes:
        path: of the folder, absolute.
    """

    def __init__(self, path: str | os.PathLike[str] | None) -> None:
        """Take a folder; None: make a temporary one, which is removed with this object. Raise UsageError."""
        self._removal: weakref.finalize[..., Any] | None = None
        try:
            self.path = Path(tempfile.mkdtemp(prefix="sim-action-") if path is None else path).absolute()
        except OSError as error:
            what = f"there can be no temporary folder: {system_reason(error)}; set TMPDIR, or give an output folder"
            raise UsageError(what) from None
        if path is None:
            self.own()

    def own(self) -> None:
        """Remove the folder with this object; a fork of this process leaves it alone."""
        self._removal = weakref.finalize(self, _remove, self.path, os.getpid())

    def __deepcopy__(self, _: object) -> RunFolder:
        """Return this object: copies of results share their folder."""
        return self

    def __reduce__(self) -> tuple[object, ...]:
        """Hand a temporary folder over to the copy, which may be in another process."""
        is_temporary = self._removal is not None and self._removal.detach() is not None
        return _taken_over, (self.path, is_temporary)

    def file(self, name: str) -> Path:
        """Return the path of a file. Raise UsageError if the folder has gone."""
        if not self.path.is_dir():
            raise UsageError(f"the folder of these results does not exist any more: {self.path}")
        return self.path / name

    def text_of(self, outcomes: Iterable[RecordedOutcome]) -> str:
        """Return the terminal report about some outcomes."""
        stream = io.StringIO()
        self._print(outcomes, Console(stream, colourful=False))
        return stream.getvalue()

    def html_of(self, outcomes: Iterable[RecordedOutcome]) -> str:
        """Return the terminal report about some outcomes for a notebook."""
        shown = HtmlConsole()
        self._print(outcomes, shown)
        return shown.html()

    def player_of(self, outcome: RecordedOutcome) -> str:
        """Return a frame with the replay of an outcome for a notebook; empty if there is none, or it is too large."""
        page = outcome_page(outcome, self._options) if outcome.replay is not None else None
        text = "" if page is None else page.text()
        return player_frame(text) if 0 < len(text) <= _MAX_EMBEDDED_BYTES else ""

    def _print(self, outcomes: Iterable[RecordedOutcome], shown: Console) -> None:
        print_outcomes(outcomes, self._options, shown)

    @property
    def _options(self) -> ReportOptions:
        return ReportOptions(
            folder=self.path, junit=self.path / JUNIT_FILE, junit_strict=False, environment={}, workspace=Path()
        )


def _taken_over(path: Path, is_temporary: bool) -> RunFolder:
    folder = RunFolder(path)
    if is_temporary:
        folder.own()
    return folder


def _remove(path: Path, owner: int) -> None:
    if os.getpid() == owner:
        shutil.rmtree(path, ignore_errors=True)


def _cause_of(record: RecordedOutcome) -> str:
    return shortened(record.reasons[0], _MAX_CAUSE)


class Outcome:
    """The outcome of one scenario; it is true if the scenario passed.

    Attributes:
        record: everything that `results.json` has about it.
        is_read: True if the program has read its verdict: its status, or the reasons for it.
    """

    def __init__(self, record: RecordedOutcome, folder: RunFolder) -> None:
        self.record = record
        self.is_read = False
        self._folder = folder

    def __bool__(self) -> bool:
        return self.passed

    @property
    def is_ignored_failure(self) -> bool:
        """True if it did not pass, and the program has not read its verdict."""
        return self.record.status not in ("passed", "skipped") and not self.is_read

    def read(self) -> RecordedOutcome:
        """Return the record to a reader of the verdict."""
        self.is_read = True
        return self.record

    @property
    def name(self) -> str:
        """The name of the scenario; a variation's name has its values."""
        return self.record.name

    @property
    def status(self) -> Status:
        """The status: "passed", "failed", "flaky", "not_exercised", "error" or "skipped"; see `GateOutcome` also."""
        return self.read().status

    @property
    def passed(self) -> bool:
        """True if every expectation was judged and held, those with `severity: warning` apart."""
        return self.read().status == "passed"

    @property
    def location(self) -> Location | None:
        """The file and line of the scenario; None if it belongs to no single file."""
        return self.record.location

    @property
    def expectations(self) -> tuple[ExpectationOutcome, ...]:
        """The expectations with their verdicts, in file order."""
        return self.read().expectations

    @property
    def failures(self) -> tuple[Failure | ExpectationOutcome, ...]:
        """The reasons why it did not pass: `errors`, and expectations; each has `message` and `location`."""
        return (*self.read().failures, *self.record.causes)

    @property
    def errors(self) -> tuple[Failure, ...]:
        """The reasons why there is no verdict; empty if there is one."""
        return self.read().failures

    @property
    def variation(self) -> dict[str, Any]:
        """The varied keys with their values."""
        return {entry.key: entry.value for entry in self.record.variation}

    @property
    def sim_time(self) -> float | None:
        """The sim time in s at the end of the run; None if it has not run."""
        return self.record.sim_time

    @property
    def digest(self) -> str | None:
        """The SHA-256 hash of the state at every physics step; None if it has not run to the end."""
        return self.record.digest

    @property
    def output(self) -> str:
        """The end of the text that the user's code printed."""
        return self.record.output

    @property
    def trace(self) -> Trace:
        """The stored run as numpy columns, see `sim_action.Trace`; read at each access. Raises UsageError."""
        if self.record.trace is None:
            raise UsageError(f"'{self.name}' has no trace: it {self.record.ending}")
        return load_trace(self._folder.file(self.record.trace))

    @property
    def text(self) -> str:
        """The part of the terminal report about this scenario."""
        return self._folder.text_of(self._shown)

    @property
    def _shown(self) -> tuple[RecordedOutcome, ...]:
        return (self.record,)

    def __repr__(self) -> str:
        cause = f", {_cause_of(self.record)!r}" if self.record.reasons else ""
        return f"Outcome(name={self.name!r}, status={self.record.status!r}{cause})"

    def _repr_html_(self) -> str:
        return self._folder.html_of(self._shown) + self._folder.player_of(self.record)


class GateOutcome(Outcome):
    """The outcome of a gate, which judges the runs of a scenario together.

    Its status can also be "inconclusive": the runs neither show nor refute what the gate claims. Its expectations are
    the claims of the gate.

    Attributes:
        statistics: the counts of the runs, and the bounds that they show.
        runs: the outcomes of its runs, in the order of the samples, including runs that an early stop skipped.
    """

    def __init__(
        self, record: RecordedOutcome, statistics: GateStatistics, runs: tuple[Outcome, ...], folder: RunFolder
    ) -> None:
        super().__init__(record, folder)
        self.statistics = statistics
        self.runs = runs

    @property
    def rate(self) -> float:
        """The share of counted runs that passed."""
        return self.statistics.rate

    @property
    def lower(self) -> float | None:
        """The lower bound of the true rate; None with `stop_early`, whose runs show no bounds."""
        return self.statistics.lower

    @property
    def upper(self) -> float | None:
        """The upper bound of the true rate; None with `stop_early`, whose runs show no bounds."""
        return self.statistics.upper

    @property
    def trace(self) -> Trace:
        """No trace: each of its runs has one. Raises UsageError."""
        raise UsageError(f"'{self.name}' is a gate, and has no trace; use that of a run, such as .runs[0].trace")

    @property
    def _shown(self) -> tuple[RecordedOutcome, ...]:
        return (self.record, *(run.record for run in self.runs))

    def __repr__(self) -> str:
        counts = f"passed {self.statistics.passed} of {self.statistics.runs} runs"
        return f"GateOutcome(name={self.name!r}, status={self.record.status!r}, {counts})"


class Results:
    """The results of a call of `sim_action.run`: a sequence of outcomes in the order of the scenarios.

    A gate is one outcome, and has its runs' outcomes. Results are true if all outcomes are.

    Attributes:
        record: everything that `results.json` has.
        outcomes: an outcome for each scenario and each gate.
    """

    def __init__(self, record: results_json.Results, exit_code: ExitCode, folder: RunFolder) -> None:
        self.record = record
        self._exit_code = exit_code
        self.outcomes = tuple(_outcomes(record, folder))
        self._folder = folder

    def __bool__(self) -> bool:
        return self.passed

    @property
    def exit_code(self) -> ExitCode:
        """The exit code that `sim-action run` would have."""
        for outcome in self.outcomes:
            outcome.read()
        return self._exit_code

    @property
    def folder(self) -> Path:
        """The folder with `results.json`, traces and reports; a temporary one is removed with the last outcome.

        A pickled copy, such as one from a pool of processes, takes a temporary folder over.
        """
        return self._folder.path

    @property
    def passed(self) -> bool:
        """True if all scenarios passed, and every report was written."""
        return self.exit_code is ExitCode.PASSED

    @property
    def gates(self) -> tuple[GateOutcome, ...]:
        """The outcomes of gates."""
        return tuple(outcome for outcome in self.outcomes if isinstance(outcome, GateOutcome))

    @property
    def runs(self) -> tuple[Outcome, ...]:
        """The outcomes of all runs, including the runs that gates judge."""
        return tuple(
            run
            for outcome in self.outcomes
            for run in (outcome.runs if isinstance(outcome, GateOutcome) else (outcome,))
        )

    def __len__(self) -> int:
        return len(self.outcomes)

    def __iter__(self) -> Iterator[Outcome]:
        return iter(self.outcomes)

    @overload
    def __getitem__(self, key: SupportsIndex | str) -> Outcome: ...

    @overload
    def __getitem__(self, key: slice) -> tuple[Outcome, ...]: ...

    def __getitem__(self, key: SupportsIndex | slice | str) -> Outcome | tuple[Outcome, ...]:
        """Return an outcome by index or by name, or several by a slice. Raise IndexError or KeyError.

        The name may also select a run of a gate.
        """
        if not isinstance(key, str):
            return self.outcomes[key]
        match = next((outcome for outcome in (*self.outcomes, *self.runs) if outcome.name == key), None)
        if match is None:
            raise KeyError(key)
        return match

    def to_junit(self, path: str | os.PathLike[str]) -> Path:
        """Write the JUnit XML to a file, and return its path."""
        return Path(shutil.copyfile(self._folder.file(JUNIT_FILE), path))

    def to_html(self, path: str | os.PathLike[str]) -> Path:
        """Write the report to a file, and return its path. Raise UsageError if there is none."""
        report = self._folder.file(REPORT_FILE)
        if not report.is_file():
            raise UsageError("there is no report: these scenarios ran with report=False")
        return Path(shutil.copyfile(report, path))

    def to_dataframe(self) -> pd.DataFrame:
        """Return a table with a row for each expectation of each run; a run without expectations has one row.

        Columns: scenario, status, engine, sim_time in s, each varied key, then expectation, verdict, measured, limit
        and margin in `unit`, time in s, and message. Raises UsageError: pandas is not installed.
        """
        try:
            import pandas as pd  # an optional package
        except ImportError:
            raise UsageError("to_dataframe() needs pandas: pip install pandas") from None
        return pd.DataFrame([row for outcome in self.runs for row in _rows(outcome)])

    @property
    def text(self) -> str:
        """The report as on the terminal, without counts and files."""
        return self._folder.text_of(self.record.outcomes)

    def __repr__(self) -> str:
        counts = Counter(outcome.record.status for outcome in self.outcomes)
        bad = next((outcome.record for outcome in self.outcomes if outcome.record.reasons), None)
        cause = f"; {bad.name!r}: {_cause_of(bad)}" if bad is not None else ""
        return f"Results({', '.join(f'{count} {status}' for status, count in counts.items())}{cause})"

    def _repr_html_(self) -> str:
        """Return the verdicts and the report with its replays, for a notebook."""
        verdicts = self._folder.html_of(self.record.outcomes)
        report = self.folder / REPORT_FILE
        if not report.is_file() or report.stat().st_size > _MAX_EMBEDDED_BYTES:
            return verdicts
        return verdicts + report_frame(report.read_text(encoding="utf-8"))


def _rows(outcome: Outcome) -> Iterator[dict[str, Any]]:
    """Yield the rows of one run in a table."""
    record = outcome.read()
    names = {"scenario": record.name, "status": record.status, "engine": record.engine, "sim_time": record.sim_time}
    of_run = {**outcome.variation, **names}
    for expectation in record.expectations:
        verdict = expectation.verdict
        values = {name: getattr(verdict, name) for name in ("measured", "limit", "margin", "unit", "time", "message")}
        yield {**names, **of_run, "expectation": expectation.name, "verdict": expectation.display_status, **values}
    if not record.expectations:
        yield {**names, **of_run, "message": "; ".join(record.reasons)}


def _outcomes(record: results_json.Results, folder: RunFolder) -> Iterator[Outcome]:
    """Yield an outcome for each scenario and each gate; a run counts by itself if its gate is not judged here."""
    runs: dict[tuple[str, str | None], list[Outcome]] = {}
    for outcome in record.runs:
        runs.setdefault((outcome.file, outcome.gate), []).append(Outcome(outcome, folder))
    judged = {(outcome.file, outcome.gate) for outcome in record.outcomes if outcome.statistics is not None}
    for outcome in record.outcomes:
        if outcome.statistics is not None:
            yield GateOutcome(outcome, outcome.statistics, tuple(runs[outcome.file, outcome.gate]), folder)
        elif outcome.gate is None or (outcome.file, outcome.gate) not in judged:
            yield Outcome(outcome, folder)
