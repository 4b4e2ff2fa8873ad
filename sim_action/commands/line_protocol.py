"""Talk to a program in lockstep over two pipes: one line goes out, and one line comes back.

Threads read and write the pipes, because Windows cannot wait for a pipe with a time limit. Only the order of the lines
counts: the time that an answer takes, within its limit, has no effect.
"""

from __future__ import annotations

import errno
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from enum import Enum, auto
from pathlib import Path
from typing import IO, Final, NamedTuple

from sim_action.core.errors import ScriptError
from sim_action.core.files import write_all
from sim_action.core.wording import escaped_line, shown

MAX_LINE_BYTES: Final = 1_000_000  # the longest line that a program may answer
_STANDARD_ERROR: Final = 2
# Time for a program to exit after the end of its input, and after it is killed.
_EXIT_WAIT_S: Final = 1.0
_KILL_WAIT_S: Final = 5.0
# Interval of checks that the program is alive, while waiting for an answer.
_POLL_S: Final = 0.1
_MAX_NAME_CHARS: Final = 60
_OUR_MODULES: Final = str(Path(__file__).resolve().parents[2])


class AnswerLimit(NamedTuple):
    """The limit on the wall time of an answer, and the key of the scenario that sets it."""

    limit_s: float
    key: str


class _End(Enum):
    """The reason why there are no more lines."""

    CLOSED = auto()
    TOO_LONG = auto()


class _Received(NamedTuple):
    """A line or the reason for its absence, and the next one if both came at once."""

    first: bytes | _End
    second: bytes | _End | None = None


class LineProcess:
    """A running program that answers each line with one line."""

    def __init__(self, arguments: Sequence[str], folder: Path, called: str) -> None:
        """Start the program in a folder. `called`: the name of the program in messages. Raises ScriptError."""
        self._name = called if len(called) <= _MAX_NAME_CHARS else f"{called[: _MAX_NAME_CHARS - 3]}..."
        self._process = self._started(arguments, folder)
        assert self._process.stderr
        self._words = StderrTail(self._process.stderr, _STANDARD_ERROR)
        self._questions = queue.SimpleQueue[bytes | None]()
        self._answers = queue.SimpleQueue[_Received]()
        self._has_answered = False
        self._reader = threading.Thread(target=self._read, daemon=True)
        for thread in (threading.Thread(target=self._write, daemon=True), self._reader):
            thread.start()

    def ask(self, question: bytes, limit: AnswerLimit) -> bytes:
        """Send a line, and return the line that answers it. Raises ScriptError."""
        if not self._answers.empty():
            self._refuse_unasked(self._answers.get().first)
        self._questions.put(question)
        try:
            answer, unasked = self._answer(limit.limit_s)
        except queue.Empty:
            raise self._error(self._silence_reason(limit)) from None
        if unasked is not None:
            self._refuse_unasked(unasked)
        if isinstance(answer, _End):
            raise self._error(self._end_reason(answer))
        self._has_answered = True
        return answer

    def _answer(self, limit_s: float) -> _Received:
        """Return the next line. Raises queue.Empty, also if the program has ended and a child of it holds the pipe."""
        deadline = time.monotonic() + limit_s
        while self._process.poll() is None:
            with suppress(queue.Empty):
                return self._answers.get(timeout=max(0.0, min(_POLL_S, deadline - time.monotonic())))
            if time.monotonic() >= deadline:
                raise queue.Empty
        # Its last lines may not have arrived yet.
        return self._answers.get(timeout=_EXIT_WAIT_S)

    def close(self) -> None:
        """Close its standard input, wait a moment for its exit, then kill it and its process group."""
        self._questions.put(None)
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_EXIT_WAIT_S)
        # Kill the process group; also after the exit of the program, because its children may be running.
        if sys.platform == "linux":
            # The system does not reuse the number of a group with members; an empty group was reaped just now.
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)
        else:
            self._process.kill()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_KILL_WAIT_S)
        self._reader.join(_EXIT_WAIT_S)
        self._words.close()

    def unasked(self) -> str | None:
        """Return a note, after `close`, if the program wrote a line too many; else None."""
        line = None if self._answers.empty() else self._answers.get().first
        if line is None or isinstance(line, _End):
            return None
        return (
            f"the process '{self._name}' wrote more lines than it received, such as {_text(line)}; if they came "
            "between its answers, each one was taken as the answer to a later line"
        )

    def refusal(self, line: bytes, why: str) -> ScriptError:
        """Return the error for a line that is not a valid answer."""
        return self._error(f"answered {_text(line)}: {why}", with_words=False)

    def _started(self, arguments: Sequence[str], folder: Path) -> subprocess.Popen[bytes]:
        try:
            # Our environment without the folder of our modules: the program may be another Python.
            first, _, others = os.environ.get("PYTHONPATH", "").partition(os.pathsep)
            kept = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
            path = others if first == _OUR_MODULES else os.environ.get("PYTHONPATH", "")
            return subprocess.Popen(  # noqa: S603 - the user wants to run this program; no shell is used
                arguments,
                cwd=folder,
                env={**kept, "PYTHONPATH": path} if path else kept,
                bufsize=0,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                # In its own process group, the program cannot kill us with its group. On other systems it stays in
                # our group, which our caller can kill.
                process_group=0 if sys.platform == "linux" else None,
            )
        except OSError as error:
            hint = start_hint(error, Path(arguments[0]))
            raise ScriptError(f"the process '{self._name}' could not be started: {error.strerror}{hint}") from None

    def _write(self) -> None:
        """Send lines until there are no more; runs in a thread."""
        assert self._process.stdin
        # If the program has ended, the end of its answers shows it.
        with suppress(OSError), self._process.stdin as pipe:
            while (question := self._questions.get()) is not None:
                data = question + b"\n"
                while data:
                    data = data[pipe.write(data) :]

    def _read(self) -> None:
        """Read lines until the pipe ends or an unexpected line comes; runs in a thread."""
        assert self._process.stdout
        unread = b""
        with self._process.stdout as pipe:
            while data := os.read(pipe.fileno(), 65536):
                *lines, unread = (unread + data).split(b"\n", 2)
                answers = [line if len(line) <= MAX_LINE_BYTES else _End.TOO_LONG for line in lines]
                if not lines and len(unread) > MAX_LINE_BYTES:
                    answers = [_End.TOO_LONG]
                if answers:
                    self._answers.put(_Received(*answers))
                if len(answers) > 1 or _End.TOO_LONG in answers or self._answers.qsize() > 1:
                    return
        self._answers.put(_Received(_End.CLOSED))

    def _refuse_unasked(self, line: bytes | _End) -> None:
        if isinstance(line, _End):
            raise self._error(self._end_reason(line))
        raise self._error(
            f"wrote an unexpected line, {_text(line)}; it must answer each line that it reads with exactly one line, "
            "and write everything else to standard error",
            with_words=False,
        )

    def _silence_reason(self, limit: AnswerLimit) -> str:
        if (gone := self._exit_reason()) is not None:
            return gone
        hint = "" if self._has_answered else "; check that it flushes its output after each line"
        return f"did not answer within {limit.limit_s:g} s of wall time ({limit.key}){hint}"

    def _end_reason(self, end: _End) -> str:
        if end is _End.TOO_LONG:
            return f"answered with a line of more than {MAX_LINE_BYTES // 1_000_000} MB"
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_EXIT_WAIT_S)
        return self._exit_reason() or "closed its standard output, but is still running"

    def _exit_reason(self) -> str | None:
        status = self._process.poll()
        if status is None:
            return None
        if status >= 0:
            return f"exited with code {status} before the end of the run"
        try:
            return f"was killed by {signal.Signals(-status).name}"
        except ValueError:
            return f"was killed by signal {-status}"

    def _error(self, what: str, *, with_words: bool = True) -> ScriptError:
        """Return an error with the last line of standard error, which is often the cause, and more in the details."""
        is_over = self._process.poll() is not None
        words = self._words.text(is_over=is_over)
        is_cause = with_words and is_over and words
        last = f"; its last line on standard error: {escaped_line(words.splitlines()[-1])}" if is_cause else ""
        return ScriptError(f"the process '{self._name}' {what}{last}", details=words)


def _text(line: bytes) -> str:
    return shown(line.decode("utf-8", errors="replace"))


def start_hint(error: OSError, program: Path) -> str:
    """Return a likely cause if an existing program cannot be started."""
    if error.errno == errno.ENOEXEC:
        return "; check that its first line names an interpreter"
    if error.errno != errno.ENOENT or not program.is_file():
        return ""
    with program.open("rb") as file:
        first = file.readline(_MAX_NAME_CHARS).decode("utf-8", errors="replace").rstrip("\n")
    return f": its first line names a missing interpreter, {shown(first)}" if first.startswith("#!") else ""


_MAX_BYTES: Final = 2_000
_MAX_LINES: Final = 20
# The last output may arrive after the program has ended. A child of the program may keep the pipe open.
_JOIN_WAIT_S: Final = 1.0


class StderrTail:
    """Reads a pipe in a thread until it ends, and keeps at most the last `max_bytes` bytes."""

    def __init__(self, pipe: IO[bytes], forward_to: int, max_bytes: int = _MAX_BYTES) -> None:
        self._pipe, self._max_bytes = pipe, max_bytes
        self._target = forward_to
        self._end = b""
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def text(self, *, is_over: bool) -> str:
        """Return the last lines; `is_over`: the program has ended, so wait for the rest of its output."""
        if is_over:
            self._thread.join(_JOIN_WAIT_S)
        return "\n".join(self.all().strip().splitlines()[-_MAX_LINES:])

    def all(self) -> str:
        """Return all text that is kept."""
        return self._end.decode("utf-8", errors="replace")

    def close(self) -> None:
        """Wait a moment until all output is forwarded."""
        self._thread.join(_JOIN_WAIT_S)

    def _listen(self) -> None:
        with self._pipe as pipe:
            while data := os.read(pipe.fileno(), 65536):
                self._end = (self._end + data)[-self._max_bytes :]
                # The program must not block if our own output is closed.
                with suppress(OSError):
                    write_all(self._target, data)
