"""A running roslaunch or rostest with all its descendants: started, watched, interrupted and ended."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from os import kill
from pathlib import Path
from typing import IO, Final, Literal, Self

from sim_action.core.process import Interruption
from sim_action.ros.processes import children, descendants, has_ended, rostest_result_path
from sim_action.ros.ros1.launch.overlay import PACKAGE_ROOT, Overlay
from sim_action.ros.ros1.launch_request import (
    FOLDER_VARIABLE,
    PROCESS_FILE,
    PROGRESS_FILE,
    SimulationResult,
    run_folders,
)
from sim_action.runner.isolation.process_control import processes

# Time for the supervisor to end all processes.
_MAX_END_S: Final = 5.0
_KILL_POLL_S: Final = 0.002
Ending = Literal["over", "interrupted", "wall limit", "output limit"]
_POLL_S: Final = 0.02
# Time for the launcher to leave after an interrupt, and for a test whose simulation has ended.
_MAX_SHUTDOWN_S: Final = 20.0
_MAX_TEST_SHUTDOWN_S: Final = 3.0
# roslaunch looks for ended nodes ten times per second, and reports none after an interrupt.
_NOTICE_S: Final = 0.5
_MAX_OUTPUT_BYTES: Final = 100_000_000


def free_port() -> int:
    """Return a free port for a master."""
    with socket.socket() as probe:
        probe.bind(("localhost", 0))
        return int(probe.getsockname()[1])


class Launch:
    """One launcher below a supervisor; the environment of every process names the `folder` of the call."""

    def __init__(self, process: subprocess.Popen[bytes], folder: Path, output: Path) -> None:
        self._process, self.supervisor = process, process.pid
        self.folder = folder
        self.output = output

    @classmethod
    def start(
        cls,
        words: Sequence[str],
        overlay: Overlay,
        folder: Path,
        more: Mapping[str, str],
        *,
        captures_output: bool = False,
    ) -> Self:
        """Start a command line that sees the overlay; its output goes to a file, or to `output_stream`."""
        output = folder / "output.txt"
        # The supervisor runs on this Python, its processes on the Python of the distribution.
        supervisor = [sys.executable, "-P", "-m", "sim_action.runner.isolation.command_supervisor"]
        variables = {**overlay.variables, **more, FOLDER_VARIABLE: str(folder), "PYTHONPATH": PACKAGE_ROOT}
        with output.open("wb") as file:
            process = subprocess.Popen(  # noqa: S603 - what the user asks for
                [*supervisor, "/usr/bin/env", f"PYTHONPATH={overlay.python_path}", *words],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE if captures_output else file,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                env=variables,
                cwd=folder,
            )
        return cls(process, folder, output)

    @property
    def output_stream(self) -> IO[bytes]:
        """The output of all processes, if `captures_output` was set."""
        assert self._process.stdout
        return self._process.stdout

    def poll(self) -> int | None:
        """Return the exit code once the launch has ended, negative for a signal; else None."""
        return self._process.poll()

    def tests(self) -> Iterator[int]:
        """Yield the ids of the test processes of rostest."""
        return (pid for pid in descendants(self._process.pid) if rostest_result_path(pid) is not None)

    def has_unnoticed_end(self) -> bool:
        """Return True if a process has ended and its parent has not noticed yet."""
        return any(map(has_ended, descendants(self._process.pid)))

    def interrupt(self) -> None:
        """Ask the launcher to end its nodes and leave."""
        for pid in children(self._process.pid):
            _send(pid, signal.SIGINT)

    def close(self) -> None:
        """Kill all remaining processes, and wait for them."""
        if self._process.poll() is None:
            _send(self._process.pid, signal.SIGTERM)
            _send(self._process.pid, signal.SIGCONT)
            try:
                self._process.wait(_MAX_END_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        # If the supervisor was killed, its processes may still run.
        while left := list(self._marked()):
            for pid in left:
                _send(pid, signal.SIGKILL)
            time.sleep(_KILL_POLL_S)

    def _marked(self) -> Iterator[int]:
        mark = f"{FOLDER_VARIABLE}={self.folder}".encode()
        for process in processes():
            with suppress(OSError):
                if mark in Path(f"/proc/{process.number}/environ").read_bytes().split(b"\0"):
                    yield process.number


def _send(pid: int, number: signal.Signals) -> None:
    with suppress(ProcessLookupError, PermissionError):
        os.kill(pid, number)


class Watch:
    """Waits for the end of one launch, until `deadline` in `time.monotonic`.

    `waits_for_progress`: True if the time in which the sim time moves on does not count. `has_tests`: True for rostest.
    """

    def __init__(self, launch: Launch, deadline: float, *, waits_for_progress: bool, has_tests: bool) -> None:
        self._launch, self._deadline, self._has_tests = launch, deadline, has_tests
        self._waits_for_progress = waits_for_progress
        self._progress = 0
        self._progressed_at = time.monotonic()
        self._ending: Ending = "over"
        self._interrupted_at: float | None = None
        self._stopped: dict[int, float] = {}
        self._ended_runs: set[Path] = set()
        self._last_look: float | None = None

    def wait(self, interruption: Interruption) -> Ending:
        """Wait until the launcher has ended, or has to be killed."""
        while self._launch.poll() is None:
            interruption.wait(_POLL_S)
            if interruption.happened:
                return "interrupted"
            if self._waits_for_progress:
                # Put the deadline off by the time in which the sim time has moved on.
                progress = max(map(_progress_ns, run_folders(self._launch.folder)[-1:]), default=0)
                if progress != self._progress:
                    now = time.monotonic()
                    # The wait for the first progress counts: it is the start of the simulation.
                    if self._progress:
                        self._deadline += now - self._progressed_at
                    self._progress, self._progressed_at = progress, now
            is_late, size = time.monotonic() > self._deadline, self._launch.output.stat().st_size
            if self._ending == "over" and (is_late or size > _MAX_OUTPUT_BYTES):
                self._ending = "wall limit" if is_late else "output limit"
                self._interrupt()
            self._look_at_runs()
            if self._interrupted_at is not None and time.monotonic() > self._interrupted_at + _MAX_SHUTDOWN_S:
                break
        return self._ending

    def _interrupt(self) -> None:
        if self._interrupted_at is None:
            self._interrupted_at = time.monotonic()
            self._launch.interrupt()

    def _look_at_runs(self) -> None:
        """Interrupt tests whose simulation has ended early, and give them a moment to write their results."""
        for run in run_folders(self._launch.folder)[-1:]:
            if run not in self._ended_runs and _is_over_early(run, self._launch):
                self._ended_runs.add(run)
                if self._has_tests:
                    self._stopped = {pid: time.monotonic() for pid in self._launch.tests()}
                    self._signal_tests(signal.SIGINT)
                else:
                    self._last_look = time.monotonic() + _NOTICE_S
        if self._last_look is not None and time.monotonic() > self._last_look and not self._launch.has_unnoticed_end():
            self._interrupt()
        if self._stopped and time.monotonic() > max(self._stopped.values()) + _MAX_TEST_SHUTDOWN_S:
            self._signal_tests(signal.SIGKILL)
            self._stopped = {}

    def _signal_tests(self, number: signal.Signals) -> None:
        for pid in set(self._launch.tests()) & self._stopped.keys():
            with suppress(ProcessLookupError):
                kill(pid, number)


def _progress_ns(run: Path) -> int:
    try:
        return (run / PROGRESS_FILE).stat().st_mtime_ns
    except OSError:
        return 0


def _is_over_early(run: Path, launch: Launch) -> bool:
    """Return True if a simulation reached its limit, failed or died."""
    result = SimulationResult.read(run)
    if result is not None:
        return result.end in ("time limit", "failed")
    process = run / PROCESS_FILE
    with suppress(OSError, ValueError):
        return int(process.read_text()) not in descendants(launch.supervisor)
    return False
