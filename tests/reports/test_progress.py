from __future__ import annotations

import io
import shutil
import subprocess
import sys

import pytest

from sim_action.reports import Verbosity
from sim_action.reports.progress import ProgressListener
from sim_action.results.journal import Finished, Progressed, RunEnded, Started
from tests.outcomes import planned_gate, runs_of_gate
from tests.reports.samples import SAMPLES


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture(autouse=True)
def terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")


def told(stream: io.StringIO, verbosity: Verbosity = "normal") -> str:
    listener = ProgressListener(total=7, verbosity=verbosity, stream=stream)
    listener(Started(0, 1, "burger drives straight"))
    listener(Progressed(0, 1, "burger drives straight", 1.25, 31.4))
    for place, name in enumerate(("passed", "crash")):
        listener(RunEnded(place, 1, SAMPLES[name].outcomes[0]))
        listener(Finished(place, SAMPLES[name].outcomes[0]))
    listener.close()
    return stream.getvalue()


def test_lines_of_finished_scenarios() -> None:
    # A line for each that is finished.
    passed, error = told(io.StringIO()).splitlines()
    assert passed == "[1/7] passed  burger drives straight  2.0 s simulated in 0.4 s"
    assert error == "[2/7] error   burger falls apart  0.7 s"
    # One rewritten line on a terminal.
    text = told(Terminal())
    assert "\n" not in text
    assert "\r\x1b[K[0/7] burger drives straight 1.2 s (31x real time)" in text
    assert text.endswith("\r\x1b[K")


def test_quiet_and_hostile_names(monkeypatch: pytest.MonkeyPatch) -> None:
    # No control sequence for a terminal that knows none.
    for name in ("dumb", "unknown"):
        with monkeypatch.context() as patch:
            patch.setenv("TERM", name)
            assert told(Terminal()) == told(io.StringIO())
    # Nothing when quiet.
    assert told(io.StringIO(), "quiet") == ""
    assert told(Terminal(), "quiet") == ""
    # A name never takes two lines.
    stream = Terminal()
    ProgressListener(1, "normal", stream)(Progressed(0, 1, "宽" * 500 + "\nx", 1.0, 1.0))
    line = stream.getvalue().removeprefix("\r\x1b[K")
    assert "\n" not in line
    assert line.count("宽") * 2 < shutil.get_terminal_size().columns
    # Hostile names command nothing.
    log = io.StringIO()
    listener = ProgressListener(1, "normal", log)
    listener(RunEnded(0, 1, SAMPLES["hostile"].outcomes[0]))
    (line,) = log.getvalue().splitlines()
    assert line.startswith("[1/1] failed  a|b")
    assert "##[" not in line


@pytest.mark.process
def test_children_are_forked_from_a_light_process() -> None:
    code = """
import sys, threading
from sim_action.reports.progress import ProgressListener
from sim_action.results.journal import Progressed
ProgressListener(1, "normal")(Progressed(0, 1, "a", 1.0, 1.0))
assert "rich" not in sys.modules
assert threading.active_count() == 1
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def told_of_gate(runs: int, verbosity: Verbosity = "normal", stream: io.StringIO | None = None) -> list[str]:
    """Half of the runs pass."""
    gate = planned_gate(runs)
    shown = stream or io.StringIO()
    listener = ProgressListener(runs, verbosity, shown, gates={(gate.file, gate.name): runs})
    for run in runs_of_gate(gate, passed=runs // 2, failed=runs - runs // 2):
        listener(RunEnded(0, 1, run))
    listener.close()
    return shown.getvalue().splitlines()


def test_lines_of_gates() -> None:
    # Runs of a gate are counted at each tenth.
    lines = told_of_gate(300)
    assert len(lines) == 10
    assert lines[0] == "[30/300] slip: 30 of 300 runs, 30 passed"
    assert lines[-1] == "[300/300] slip: 300 of 300 runs, 150 passed"
    # A line for each run of a gate if verbose does not call it failed.
    assert told_of_gate(2, "verbose") == [
        "[1/2] slip[friction=0.01] passed  3.0 s simulated in 1.0 s",
        "[2/2] slip[friction=0.02] did not pass (failed)  3.0 s simulated in 1.0 s",
    ]
    assert told_of_gate(2, "quiet") == []
    # The line on a terminal has the count of the gate.
    gate = planned_gate(2)
    stream = Terminal()
    listener = ProgressListener(2, "normal", stream, gates={(gate.file, gate.name): 2})
    listener(RunEnded(0, 1, runs_of_gate(gate, failed=1)[0]))
    listener(Progressed(1, 1, "slip[friction=0.02]", 1.25, 31.4))
    assert "[1/2] slip: 1 of 2 runs, 0 passed; slip[friction=0.02] 1.2 s" in stream.getvalue()
    # Runs that are taken over count for their gate.
    gate = planned_gate(2)
    first, second = runs_of_gate(gate, passed=2)
    log = io.StringIO()
    listener = ProgressListener(1, "normal", log, gates={(gate.file, gate.name): 2})
    listener(Finished(0, first, taken_over=True))
    listener(RunEnded(1, 1, second))
    assert log.getvalue() == "[1/1] slip: 2 of 2 runs, 2 passed\n"
