"""The output of a child process: everything that it prints, and a stack dump just before its time is up."""

from __future__ import annotations

import ctypes
import faulthandler
import os
import re
import signal
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Final, Literal, TextIO

from sim_action.core.errors import Location
from sim_action.engines import ENGINES
from sim_action.results.outcome import Diagnostic

# Messages of Bullet have no line end of their own: a marker begins where the last message stops. Other
# engines print lines such as "mujoco warning: ...".
_MARKER: Final = re.compile(
    rf"(?:b3(Printf|Warning|Error)\[[^\]\n]*\]:?\n?|^(?:{'|'.join(ENGINES)}) (warning): )", re.MULTILINE
)
_BANNER: Final = re.compile(r"pybullet build time: .*\n?")
_LEVELS: Final[dict[str, Literal["note", "warning", "error"]]] = {
    "Printf": "note",
    "Warning": "warning",
    "Error": "error",
    "warning": "warning",
}
_UNBUFFERED: Final = 2  # _IONBF of glibc's stdio.h
_MAX_DIAGNOSTICS: Final = 50
_APPEND: Final = os.O_WRONLY | os.O_CREAT | os.O_APPEND | getattr(os, "O_BINARY", 0)


def is_open(descriptor: int) -> bool:
    """Return True if a descriptor of this process is open."""
    try:
        os.fstat(descriptor)
    except OSError:
        return False
    return True


def redirect_output(place: int | Path) -> None:
    """Send everything that this process and its children print to a file, and leave standard input empty.

    `place`: a descriptor that appends, or a path. Raise OSError.

    On Linux, the buffer of C's stdout is switched off, so that the last output of a crashed process is kept: PyBullet
    uses it, and runs on Linux only.
    """
    target = place if isinstance(place, int) else os.open(place, _APPEND, 0o600)
    nothing = os.open(os.devnull, os.O_RDONLY)
    for source, descriptor in ((nothing, 0), (target, 1), (target, 2)):
        os.dup2(source, descriptor)
    sys.stdout, sys.stderr = _text_to(1), _text_to(2)
    if sys.platform == "linux":
        _libc().setvbuf(ctypes.c_void_p.in_dll(_libc(), "stdout"), None, _UNBUFFERED, 0)


def _text_to(descriptor: int) -> TextIO:
    return os.fdopen(os.dup(descriptor), "w", buffering=1, encoding="utf-8", errors="backslashreplace", newline="\n")


def flush_output() -> None:
    """Write out what Python and native code have printed so far; a forked process would have a copy of it."""
    for stream in (sys.stdout, sys.stderr):
        # A stream on a full disk is no reason not to run.
        with suppress(OSError, ValueError):
            stream.flush()
    if sys.platform == "linux":
        _libc().fflush(None)


@cache
def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None)


@contextmanager
def muted() -> Iterator[None]:
    """Discard everything that Python or native code prints in this context."""
    flush_output()
    saved = [os.dup(1), os.dup(2)]
    nothing = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nothing, 1)
        os.dup2(nothing, 2)
        yield
    finally:
        flush_output()
        for descriptor, original in zip((1, 2), saved, strict=True):
            os.dup2(original, descriptor)
            os.close(original)
        os.close(nothing)


def split_output(text: str) -> tuple[tuple[Diagnostic, ...], str]:
    """Return the messages of engines, each once, and the rest of the output."""
    pieces = _MARKER.split(_BANNER.sub("", text))
    rest = [pieces[0]]
    diagnostics = dict[Diagnostic, None]()
    for bullets, mujocos, body in zip(pieces[1::3], pieces[2::3], pieces[3::3], strict=True):
        # A message ends with its line; the following text is other output.
        message, _, after = body.partition("\n")
        if message.strip():
            diagnostics[Diagnostic(level=_LEVELS[bullets or mujocos], message=message.strip())] = None
        rest.append(after)
    return tuple(diagnostics)[:_MAX_DIAGNOSTICS], "".join(rest).strip("\n")


# The dump is written this long before the deadline: at most a share of the time, at most so many seconds.
_BEFORE_S: Final = 1.0
_BEFORE_SHARE: Final = 0.1
_FRAME: Final = re.compile(r'^  File "(?P<file>.*)", line (?P<line>\d{1,9}) in ', re.MULTILINE)


def dump_stack_before(deadline: float, place: int | Path) -> None:
    """Write a stack dump of this process to a file just before a deadline on `time.monotonic()`.

    `place`: a descriptor, or a path. Raise OSError.

    It also works while native code hangs, because no Python code runs for it. If user code sets its own alarm, there
    is no dump.
    """
    left = deadline - time.monotonic()
    until = left - min(_BEFORE_S, _BEFORE_SHARE * left)
    if until <= 0:
        return
    # `faulthandler` keeps the file open.
    noted = open(place, "w", encoding="ascii")  # noqa: PTH123, SIM115 - it may be a descriptor
    if sys.platform == "win32":
        faulthandler.dump_traceback_later(until, file=noted)
    else:
        # The main thread dumps its own stack and waits meanwhile: another thread would read frames that vanish, and the
        # process would crash.
        faulthandler.register(signal.SIGALRM, file=noted, all_threads=False)
        signal.setitimer(signal.ITIMER_REAL, until)


def place_in_stack_dump(text: str, files: Iterable[Path]) -> Location | None:
    """Return the innermost line of a user's file in a stack dump, whose text cannot be trusted."""
    paths = {str(file).encode("ascii", "backslashreplace").decode(): str(file) for file in files}
    innermost = next((frame for frame in _FRAME.finditer(text) if frame["file"] in paths), None)
    return None if innermost is None else Location(paths[innermost["file"]], int(innermost["line"]))
