"""The progress of a run: one line that a terminal rewrites, otherwise one line for each finished scenario.

The runs of a gate have no lines of their own, unless verbose: their number is printed after each tenth of them. A run
that did not pass is no failure, so its line does not say so.
"""

from __future__ import annotations

import os
import shutil
import sys
import time
import unicodedata
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final, TextIO

from sim_action.core.records import dataclass
from sim_action.core.wording import counted
from sim_action.reports import Verbosity
from sim_action.reports.display import STATUS_DISPLAYS, is_full_terminal
from sim_action.reports.escaping import log_text, one_line
from sim_action.reports.formatting import speed_text
from sim_action.results.journal import Event, Finished, Progressed, RunEnded
from sim_action.results.outcome import Outcome

_REDRAW_PERIOD_S: Final = 0.1
_ERASE: Final = "\r\x1b[K"
_STEPS: Final = 10
GateKey = tuple[str, str]  # the file and the name of a gate
_NO_GATES: Final[Mapping[GateKey, int]] = MappingProxyType({})


@dataclass(slots=True)
class _RunsOfGate:
    """The runs of a gate that are finished; `total`: all of this call."""

    name: str
    total: int
    done: int = 0
    passed: int = 0

    def add(self, outcome: Outcome) -> bool:
        """Count a run, and return True if another tenth of the runs is finished."""
        before = self.done * _STEPS // self.total
        self.done += 1
        self.passed += outcome.status == "passed"
        return self.done * _STEPS // self.total > before

    def __str__(self) -> str:
        return f"{one_line(self.name)}: {self.done} of {counted(self.total, 'run')}, {self.passed} passed"


class ProgressListener:
    """A listener that prints progress, without a thread, a buffer or a large import: children are forked."""

    def __init__(
        self,
        total: int,
        verbosity: Verbosity,
        stream: TextIO | None = None,
        gates: Mapping[GateKey, int] = _NO_GATES,
        word_of: Callable[[RunEnded], str] | None = None,
    ) -> None:
        """Report on `total` scenarios, and on runs of `gates`, to a stream; `word_of`: gives the word for a result."""
        self._stream = stream or sys.stderr
        self._silent = verbosity == "quiet"
        self._shows_samples = verbosity == "verbose"
        self._gates = {key: _RunsOfGate(key[1], runs) for key, runs in gates.items()}
        self._gate: _RunsOfGate | None = None
        self._rewrites = is_full_terminal(self._stream, os.environ)
        self._total = total
        self._word_of = word_of or (lambda ended: f"{STATUS_DISPLAYS[ended.outcome.status].word:<6}")
        self._done = 0
        self._running: dict[str, str] = {}
        self._shown_at = float("-inf")

    def __call__(self, event: Event) -> None:
        """Show an event."""
        match event:
            case Progressed():
                self._show_progress(event)
            case RunEnded():
                self._show_outcome(event)
            case Finished(taken_over=True):
                self._count(event.outcome)

    def _show_progress(self, event: Progressed) -> None:
        if self._silent or not self._rewrites:
            return
        speed = speed_text(event.real_time_factor)
        self._running[event.name] = f"{one_line(event.name)} {event.sim_time:.1f} s ({speed})"
        if time.monotonic() - self._shown_at >= _REDRAW_PERIOD_S:
            self._shown_at = time.monotonic()
            gate = "" if self._gate is None else f"{self._gate}; "
            self._rewrite(f"[{self._done}/{self._total}] {gate}{', '.join(self._running.values())}")

    def _show_outcome(self, ended: RunEnded) -> None:
        outcome = ended.outcome
        self._done += 1
        self._running.pop(outcome.name, None)
        is_step = self._count(outcome)
        if self._silent:
            return
        if self._rewrites:
            self.close()
        elif self._gate is None or self._shows_samples:
            self._write(f"{self._readable(self._summed_up(ended))}\n")
        elif is_step:
            self._write(f"{self._readable(f'[{self._done}/{self._total}] {self._gate}')}\n")

    def _count(self, outcome: Outcome) -> bool:
        self._gate = None if outcome.gate is None else self._gates.get((outcome.file, outcome.gate))
        return self._gate is not None and outcome.status != "skipped" and self._gate.add(outcome)

    def close(self) -> None:
        """Erase the progress line; to be called when the run has finished or was interrupted."""
        if self._rewrites and not self._silent:
            self._write(_ERASE)

    def _summed_up(self, ended: RunEnded) -> str:
        outcome = ended.outcome
        simulated = f"{outcome.sim_time:.1f} s simulated in " if outcome.sim_time is not None else ""
        counter = f"[{self._done}/{self._total}]"
        word = self._word_of(ended)
        took = f"{simulated}{outcome.wall_time:.1f} s"
        if self._gate is not None:
            verdict = "passed" if outcome.status == "passed" else f"did not pass ({word.strip()})"
            return f"{counter} {one_line(outcome.name)} {verdict}  {took}"
        return f"{counter} {word}  {one_line(outcome.name)}  {took}"

    def _rewrite(self, line: str) -> None:
        # One column stays free, because some terminals wrap after a full line.
        columns = shutil.get_terminal_size().columns - 1
        self._write(_ERASE + _cut(self._readable(line), columns))

    def _readable(self, text: str) -> str:
        return log_text(text, self._stream.encoding or "utf-8")

    def _write(self, text: str) -> None:
        try:
            self._stream.write(text)
            # Text in the buffer during a fork would be written by parent and child.
            self._stream.flush()
        except OSError:
            # The reader has closed the stream; the run continues.
            self._silent = True


def _cut(text: str, columns: int) -> str:
    """Return the beginning of a text that fits into `columns`; East Asian wide characters take two columns."""
    for index, character in enumerate(text):
        columns -= 2 if unicodedata.east_asian_width(character) in "WF" else 1
        if columns < 0:
            return text[:index]
    return text
