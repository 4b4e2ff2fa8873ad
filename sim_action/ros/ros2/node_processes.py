"""The processes of nodes and of the bridge: started in groups of their own, watched, and ended.

The output of each goes to a file. A pipe that is full would put a node to sleep although it has work left.
"""

from __future__ import annotations

import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from sim_action.commands.line_protocol import start_hint
from sim_action.core.errors import ScriptError
from sim_action.core.files import write_all
from sim_action.core.records import dataclass

# The wall time that nodes get to save something after SIGINT, and after SIGTERM.
_SIGINT_WAIT_S: Final = 2.0
_SIGTERM_WAIT_S: Final = 0.5
_POLL_S: Final = 0.005
_STANDARD_OUTPUT: Final = 1
# The output that is kept for messages, and the size of a file from which on it is emptied after it was forwarded.
_MAX_KEPT_BYTES: Final = 100_000
_MAX_FILE_BYTES: Final = 10_000_000


class NodeProcess:
    """A running program and its output."""

    def __init__(self, label: str, process: subprocess.Popen[bytes], output: Path) -> None:
        self.label = label
        self._process, self.pid = process, process.pid
        self._output = output.open("rb")
        self._path = output
        self._kept = self._line = b""

    def exit_code(self) -> int | None:
        """Return the exit code once it has ended, negative for a signal; else None."""
        return self._process.poll()

    def await_end(self, seconds: float) -> None:
        """Wait until it has ended, for at most some s of wall time."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(seconds)

    def text(self) -> str:
        """Return the end of all output so far."""
        self.forward()
        return self._kept.decode("utf-8", errors="replace")

    def forward(self) -> None:
        """Write new lines to our standard output, each with the name of the node. Call it while the process waits."""
        while data := self._output.read(1 << 20):
            self._kept = (self._kept + data)[-_MAX_KEPT_BYTES:]
            *lines, self._line = (self._line + data).split(b"\n")
            label = self.label.encode(errors="replace")
            with suppress(OSError):
                write_all(_STANDARD_OUTPUT, b"".join(b"[%s] %s\n" % (label, line) for line in lines))
        if self._output.tell() > _MAX_FILE_BYTES:
            os.truncate(self._path, 0)
            self._output.seek(0)

    def signal_group(self, number: signal.Signals) -> None:
        """Send a signal to the process and to all that it has started in its group."""
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, number)

    def close(self) -> None:
        """Kill the rest of the group, and reap the process."""
        self.signal_group(signal.SIGKILL)
        self._process.wait()
        self._output.close()


class ProcessFolder:
    """A scratch folder in which processes of one run are started, all with the same environment."""

    def __init__(self, working_directory: Path, environment: Mapping[str, str]) -> None:
        self._scratch = tempfile.TemporaryDirectory(prefix="sim-action-ros2-")
        self._working_directory = working_directory
        self.path = Path(self._scratch.name)
        self.environment = dict(environment)
        self._started: list[NodeProcess] = []
        self._forwarded: list[NodeProcess] = []

    def start(
        self, label: str, words: Sequence[str], *, kept: Sequence[int] = (), forwards: bool = True, stdin: str = ""
    ) -> NodeProcess:
        """Start a program; `kept`: descriptors for it; `forwards`: its output is for the user. Raise ScriptError."""
        output = self.path / f"output-{len(self._started)}.txt"
        stdin_path = self.path / f"input-{len(self._started)}.txt"
        stdin_path.write_text(stdin, encoding="utf-8")
        with output.open("ab") as file, stdin_path.open("rb") as source:
            try:
                process = subprocess.Popen(  # noqa: S603 - what the user asks for; no shell is used
                    words,
                    cwd=self._working_directory,
                    env=self.environment,
                    stdin=source,
                    stdout=file,
                    stderr=subprocess.STDOUT,
                    pass_fds=kept,
                    process_group=0,
                )
            except OSError as error:
                why = f"{error.strerror}{start_hint(error, Path(words[0])) or f': {words[0]}'}"
                raise ScriptError(f"'{label}' could not be started: {why}") from None
        self._started.append(NodeProcess(label, process, output))
        if forwards:
            self._forwarded.append(self._started[-1])
        return self._started[-1]

    def forward(self) -> None:
        """Write new lines of all programs to our standard output. Call it while they wait."""
        for process in self._forwarded:
            process.forward()

    def close(self) -> None:
        """End all processes: interrupt them, terminate them, and kill the rest. Their tracebacks are not forwarded."""
        for number, wait_s in ((signal.SIGINT, _SIGINT_WAIT_S), (signal.SIGTERM, _SIGTERM_WAIT_S)):
            for process in self._started:
                if process.exit_code() is None:
                    process.signal_group(number)
            deadline = time.monotonic() + wait_s
            while any(process.exit_code() is None for process in self._started) and time.monotonic() < deadline:
                time.sleep(_POLL_S)
        for process in self._started:
            process.close()
        self._scratch.cleanup()


class LaunchedProcess:
    """A process of a launch with a clock; `label`: such as "mover-1", or the name of a node in a container."""

    def __init__(self, label: str, pid: int, look: Callable[[], object]) -> None:
        self.label, self.pid = label, pid
        self.code: int | None = None
        self._look = look

    def exit_code(self) -> int | None:
        """Return the exit code once it has ended, negative for a signal; else None."""
        return self.code

    def await_end(self, seconds: float) -> None:
        """Wait until it has ended, for at most some s of wall time. Raise ScriptError if it has failed."""
        deadline = time.monotonic() + seconds
        while self.code is None and time.monotonic() < deadline:
            self._look()
            time.sleep(_POLL_S)


@dataclass(frozen=True, slots=True)
class Node:
    """A process with a clock of its own; `number`: of its clock, in a namespace such as "robot2/_0"."""

    number: int | str
    process: NodeProcess | LaunchedProcess


class NodeGroup:
    """All nodes of a scenario; a base class. `roots`: ids of the processes from which all others descend."""

    def __init__(self, roots: Sequence[int]) -> None:
        self.roots = roots
        self.notes: list[str] = []
        self.losses: list[str] = []

    def await_start(self) -> None:
        """Wait until the first nodes are started. Raise SourceProblem, ScriptError."""

    def tell_time(self, seconds: float) -> None:
        """Start the actions that are due at a sim time, in s. Raise ScriptError."""

    def new_nodes(self) -> list[Node]:
        """Return the nodes that were started since the last call, in a fixed order. Raise ScriptError."""
        raise NotImplementedError

    def refuse_ended(self) -> None:
        """Raise ScriptError if a node has failed, or a required one has finished."""
        raise NotImplementedError

    def close(self) -> None:
        """End the nodes, as far as the folder of the processes does not."""
