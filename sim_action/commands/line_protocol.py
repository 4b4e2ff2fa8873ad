"""A program at the other end of two pipes: a line goes out, a line comes back, and nothing happens in between.

Pipes are read and written in threads, since that is what every system has: on Windows, nobody can wait for a pipe with
a time limit. What decides is the order of lines alone; how long an answer takes within its limit changes nothing.
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
from typing import Final, NamedTuple

from sim_action.commands.stderr_tail import LastWords
from sim_action.core.errors import ScriptError
from sim_action.core.messages import escaped_line, shown

MOST_BYTES: Final = 1_000_000
"""Of a line that is answered."""

_STANDARD_ERROR: Final = 2
# How long a program may take to leave when it is told that there is nothing more, in s, and to be gone when killed.
_LEAVING: Final = 1.0
_DYING: Final = 5.0
# How often it is looked after while it is waited for, in s.
_LOOK: Final = 0.1
_MOST_NAME: Final = 60
_OUR_MODULES: Final = str(Path(__file__).resolve().parents[2])


class Patience(NamedTuple):
    """How many s of wall time an answer may take, and the key of the scenario that says so."""

    seconds: float
    key: str


class _End(Enum):
    """Why there are no more lines."""

    CLOSED = auto()
    TOO_LONG = auto()


class _Said(NamedTuple):
    """A line, or why there is none, and the one behind it if both came at once."""

    first: bytes | _End
    second: bytes | _End | None = None


class Lockstep:
    """A running program, which is asked line by line."""

    def __init__(self, arguments: Sequence[str], folder: Path, called: str) -> None:
        """Starts it in a folder; `called`: how messages call it. Raises ScriptError."""
        self._name = called if len(called) <= _MOST_NAME else f"{called[: _MOST_NAME - 3]}..."
        self._process = self._started(arguments, folder)
        assert self._process.stderr
        self._words = LastWords(self._process.stderr, _STANDARD_ERROR)
        self._questions = queue.SimpleQueue[bytes | None]()
        self._answers = queue.SimpleQueue[_Said]()
        self._has_answered = False
        self._reader = threading.Thread(target=self._read, daemon=True)
        for thread in (threading.Thread(target=self._write, daemon=True), self._reader):
            thread.start()

    def ask(self, question: bytes, patience: Patience) -> bytes:
        """Sends a line, and returns the line that answers it. Raises ScriptError."""
        if not self._answers.empty():
            self._refuse_unasked(self._answers.get().first)
        self._questions.put(question)
        try:
            answer, unasked = self._answer(patience.seconds)
        except queue.Empty:
            raise self._error(self._why_silent(patience)) from None
        if unasked is not None:
            self._refuse_unasked(unasked)
        if isinstance(answer, _End):
            raise self._error(self._why_ended(answer))
        self._has_answered = True
        return answer

    def _answer(self, seconds: float) -> _Said:
        """Raises queue.Empty, also when it is gone and what it has left behind holds its output."""
        deadline = time.monotonic() + seconds
        while self._process.poll() is None:
            with suppress(queue.Empty):
                return self._answers.get(timeout=max(0.0, min(_LOOK, deadline - time.monotonic())))
            if time.monotonic() >= deadline:
                raise queue.Empty
        # Its last lines may be on their way.
        return self._answers.get(timeout=_LEAVING)

    def close(self) -> None:
        """Closes its standard input, waits a moment for it to leave, and ends it and its process group."""
        self._questions.put(None)
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_LEAVING)
        self._kill()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_DYING)
        self._reader.join(_LEAVING)
        self._words.close()

    def unasked(self) -> str | None:
        """What to say of a line, after it is closed, that answers no question."""
        line = None if self._answers.empty() else self._answers.get().first
        if line is None or isinstance(line, _End):
            return None
        return (
            f"the process '{self._name}' wrote more lines than it was asked for, such as {_text(line)}; if those came "
            "between its answers, each was taken for the answer to a later question"
        )

    def refusal(self, line: bytes, why: str) -> ScriptError:
        """What to say of a line that is no answer."""
        return self._error(f"answered {_text(line)}: {why}", with_words=False)

    def _started(self, arguments: Sequence[str], folder: Path) -> subprocess.Popen[bytes]:
        try:
            return subprocess.Popen(  # noqa: S603 - it is what the user wants to be run, and no shell is
                arguments,
                cwd=folder,
                env=_environment(),
                bufsize=0,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                # In a group of its own, it cannot end us by ending that. Elsewhere it stays in ours, which is what the
                # caller can end when we are gone.
                process_group=0 if sys.platform == "linux" else None,
            )
        except OSError as error:
            hint = _hint(error, Path(arguments[0]))
            raise ScriptError(f"the process '{self._name}' cannot be started: {error.strerror}{hint}") from None

    def _write(self) -> None:
        """Thread: sends questions until there are no more."""
        assert self._process.stdin
        # It may be gone: the end of its answers says so.
        with suppress(OSError), self._process.stdin as pipe:
            while (question := self._questions.get()) is not None:
                data = question + b"\n"
                while data:
                    data = data[pipe.write(data) :]

    def _read(self) -> None:
        """Thread: takes in lines until there are no more, or one that nobody asked for."""
        assert self._process.stdout
        unread = b""
        with self._process.stdout as pipe:
            while said := os.read(pipe.fileno(), 65536):
                *lines, unread = (unread + said).split(b"\n", 2)
                answers = [line if len(line) <= MOST_BYTES else _End.TOO_LONG for line in lines]
                if not lines and len(unread) > MOST_BYTES:
                    answers = [_End.TOO_LONG]
                if answers:
                    self._answers.put(_Said(*answers))
                if len(answers) > 1 or _End.TOO_LONG in answers or self._answers.qsize() > 1:
                    return
        self._answers.put(_Said(_End.CLOSED))

    def _refuse_unasked(self, line: bytes | _End) -> None:
        if isinstance(line, _End):
            raise self._error(self._why_ended(line))
        raise self._error(
            f"wrote a line that nobody had asked for, {_text(line)}; each line that it reads is answered by one line, "
            "and everything else belongs on standard error",
            with_words=False,
        )

    def _why_silent(self, patience: Patience) -> str:
        if (gone := self._how_gone()) is not None:
            return gone
        hint = "" if self._has_answered else "; does it flush its output after each line?"
        return f"gave no answer within {patience.seconds:g} s of wall time ({patience.key}){hint}"

    def _why_ended(self, end: _End) -> str:
        if end is _End.TOO_LONG:
            return f"answered a line of more than {MOST_BYTES // 1_000_000} MB"
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_LEAVING)
        return self._how_gone() or "closed its standard output, and goes on"

    def _how_gone(self) -> str | None:
        status = self._process.poll()
        if status is None:
            return None
        if status >= 0:
            return f"ended by itself, with exit code {status}, before the run was over"
        try:
            return f"was ended by {signal.Signals(-status).name}"
        except ValueError:
            return f"was ended by signal {-status}"

    def _error(self, what: str, *, with_words: bool = True) -> ScriptError:
        """The last line of its standard error is often the cause; all that is kept goes with it."""
        is_over = self._process.poll() is not None
        words = self._words.text(is_over=is_over)
        is_cause = with_words and is_over and words
        said = f"; the last that it said: {escaped_line(words.splitlines()[-1])}" if is_cause else ""
        return ScriptError(f"the process '{self._name}' {what}{said}", details=words)

    def _kill(self) -> None:
        """Also when it has left by itself: what it started may be there."""
        if sys.platform == "linux":
            # While the group has a member, no other gets its number; it was reaped a moment ago, if it has none.
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)
        else:
            self._process.kill()


def _text(line: bytes) -> str:
    return shown(line.decode("utf-8", errors="replace"))


def _environment() -> dict[str, str]:
    """Ours, without the folder of our own modules, which are not those of another Python."""
    first, _, others = os.environ.get("PYTHONPATH", "").partition(os.pathsep)
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    path = others if first == _OUR_MODULES else os.environ.get("PYTHONPATH", "")
    return {**kept, "PYTHONPATH": path} if path else kept


def _hint(error: OSError, program: Path) -> str:
    """What may be the cause if a program that is there cannot be started."""
    if error.errno == errno.ENOEXEC:
        return "; does its first line name what runs it?"
    if error.errno != errno.ENOENT or not program.is_file():
        return ""
    with program.open("rb") as file:
        first = file.readline(_MOST_NAME).decode("utf-8", errors="replace").rstrip("\n")
    return f": it is there, but not what its first line names, {shown(first)}" if first.startswith("#!") else ""
