"""Waits for a launch to be over, and ends what would never be: a test without a simulation, and what takes too long."""

from __future__ import annotations

import select
import signal
import time
from contextlib import suppress
from os import kill
from pathlib import Path
from typing import Final, Literal

from sim_action.core.process import Interruption
from sim_action.ros.ros1.exchange import PROCESS_FILE, NodeRun, runs_in
from sim_action.ros.ros1.launch import Launch
from sim_action.ros.ros1.siblings import descendants

Ending = Literal["over", "interrupted", "wall limit", "output limit"]

_LOOK: Final = 0.02
# In s: how long a launcher may take once it is told to leave, and a test whose simulation is over.
_LEAVING: Final = 20.0
_TEST_LEAVING: Final = 3.0
# In s: roslaunch looks for nodes that have died ten times a second, and tells of none once it has to leave.
_LAST_LOOK: Final = 0.5
_MOST_OUTPUT: Final = 100_000_000


class Watch:
    """One launch, until it is over; `deadline`: of `time.monotonic`."""

    def __init__(self, launch: Launch, deadline: float, *, has_tests: bool) -> None:
        self._launch, self._deadline, self._has_tests = launch, deadline, has_tests
        self._ending: Ending = "over"
        self._told_at: float | None = None
        self._stopped: dict[int, float] = {}
        self._ended_runs: set[Path] = set()
        self._last_look: float | None = None

    def wait(self, interruption: Interruption) -> Ending:
        """Returns when the launcher has gone, or has to be ended."""
        while self._launch.poll() is None:
            select.select([interruption.awakened], [], [], _LOOK)
            if interruption.happened:
                return "interrupted"
            self._look_at_limits()
            self._look_at_runs()
            if self._told_at is not None and time.monotonic() > self._told_at + _LEAVING:
                break
        return self._ending

    def _look_at_limits(self) -> None:
        if self._ending == "over" and time.monotonic() > self._deadline:
            self._ending = "wall limit"
            self._tell_to_leave()
        if self._ending == "over" and self._launch.output.stat().st_size > _MOST_OUTPUT:
            self._ending = "output limit"
            self._tell_to_leave()

    def _tell_to_leave(self) -> None:
        if self._told_at is None:
            self._told_at = time.monotonic()
            self._launch.interrupt()

    def _look_at_runs(self) -> None:
        """Nothing comes of a test once its simulation is over, but for a moment to say what it has found."""
        for run in runs_in(self._launch.folder)[-1:]:
            if run not in self._ended_runs and _is_over_early(run, self._launch):
                self._ended_runs.add(run)
                if self._has_tests:
                    self._stopped = {pid: time.monotonic() for pid in self._launch.tests()}
                    self._signal_tests(signal.SIGINT)
                else:
                    self._last_look = time.monotonic() + _LAST_LOOK
        if self._last_look is not None and time.monotonic() > self._last_look and not self._launch.has_unnoticed():
            self._tell_to_leave()
        if self._stopped and time.monotonic() > max(self._stopped.values()) + _TEST_LEAVING:
            self._signal_tests(signal.SIGKILL)
            self._stopped = {}

    def _signal_tests(self, number: signal.Signals) -> None:
        for pid in set(self._launch.tests()) & self._stopped.keys():
            with suppress(ProcessLookupError):
                kill(pid, number)


def _is_over_early(run: Path, launch: Launch) -> bool:
    """Whether a simulation has come to its limit, could not go on, or has died."""
    told = NodeRun.read(run)
    if told is not None:
        return told.end in ("time limit", "failed")
    process = run / PROCESS_FILE
    with suppress(OSError, ValueError):
        return int(process.read_text()) not in descendants(launch.keeper)
    return False
