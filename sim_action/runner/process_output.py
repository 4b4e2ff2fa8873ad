"""What engines print below Python: caught at the level of file descriptors, and made into diagnostics."""

from __future__ import annotations

import ctypes
import faulthandler
import os
import re
import signal
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final, Literal, TextIO

from sim_action.core.errors import Location
from sim_action.results.outcome import Diagnostic

# Bullet's messages carry no line end of their own: a marker begins where the message before it stops. MuJoCo's are
# lines that `backends.mujoco` prints.
_MARKER: Final = re.compile(r"(?:b3(Printf|Warning|Error)\[[^\]\n]*\]:?\n?|^mujoco (warning): )", re.MULTILINE)
_BANNER: Final = re.compile(r"pybullet build time: .*\n?")
_LEVELS: Final[dict[str, Literal["note", "warning", "error"]]] = {
    "Printf": "note",
    "Warning": "warning",
    "Error": "error",
    "warning": "warning",
}
_UNBUFFERED: Final = 2  # _IONBF of glibc's stdio.h
_MOST_DIAGNOSTICS: Final = 50


def redirect_output(path: Path) -> None:
    """From now on, everything that this process and its children print goes to a file, and nothing is read.

    On Linux, C's own buffer is switched off, so that the last words of a process that dies are there: PyBullet uses it,
    which is to be had there alone.
    """
    target = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | getattr(os, "O_BINARY", 0), 0o600)
    nothing = os.open(os.devnull, os.O_RDONLY)
    for source, descriptor in ((nothing, 0), (target, 1), (target, 2)):
        os.dup2(source, descriptor)
    sys.stdout, sys.stderr = _text_to(1), _text_to(2)
    if sys.platform == "linux":
        libc = ctypes.CDLL(None)
        libc.setvbuf(ctypes.c_void_p.in_dll(libc, "stdout"), None, _UNBUFFERED, 0)


def _text_to(descriptor: int) -> TextIO:
    """As the output is read: whatever the code page of a Windows console is, UTF-8."""
    return os.fdopen(os.dup(descriptor), "w", buffering=1, encoding="utf-8", errors="backslashreplace", newline="\n")


@contextmanager
def muted() -> Iterator[None]:
    """Nothing that is printed meanwhile, by Python or below it, is seen."""
    sys.stdout.flush()
    sys.stderr.flush()
    saved = [os.dup(1), os.dup(2)]
    nothing = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nothing, 1)
        os.dup2(nothing, 2)
        yield
    finally:
        for descriptor, original in zip((1, 2), saved, strict=True):
            os.dup2(original, descriptor)
            os.close(original)
        os.close(nothing)


def split_output(text: str) -> tuple[tuple[Diagnostic, ...], str]:
    """The engine's messages, each once, and what else was printed."""
    pieces = _MARKER.split(_BANNER.sub("", text))
    rest, found = [pieces[0]], dict[Diagnostic, None]()
    for bullets, mujocos, body in zip(pieces[1::3], pieces[2::3], pieces[3::3], strict=True):
        # A message ends with its line; what follows belongs to whoever printed it.
        message, _, after = body.partition("\n")
        if message.strip():
            found[Diagnostic(level=_LEVELS[bullets or mujocos], message=message.strip())] = None
        rest.append(after)
    return tuple(found)[:_MOST_DIAGNOSTICS], "".join(rest).strip("\n")


# What is looked at is about to be ended, in s: as a part of its time, no less than it takes to look.
_BEFORE: Final = 0.2
_PART: Final = 0.1
_FRAME: Final = re.compile(r'^  File "(?P<file>.*)", line (?P<line>\d{1,9}) in ', re.MULTILINE)


def note_before(deadline: float, file: Path) -> None:
    """Just before a time of `time.monotonic()`, writes to a file where this process is.

    What hangs in native code is seen, too: no Python runs for it. Where code has an alarm of its own, nothing is noted.
    """
    left = deadline - time.monotonic()
    until = left - min(_BEFORE, _PART * left)
    if until <= 0:
        return
    noted = file.open("w", encoding="ascii")
    if sys.platform == "win32":
        faulthandler.dump_traceback_later(until, file=noted)
    else:
        # The main thread notes itself, and stands still meanwhile: read by another one, frames may vanish, and the
        # process would end with a segmentation fault.
        faulthandler.register(signal.SIGALRM, file=noted, all_threads=False)
        signal.setitimer(signal.ITIMER_REAL, until)


def noted_place(text: str, files: Iterable[Path]) -> Location | None:
    """The innermost line of one of the user's files in what was noted, which may be anybody's words."""
    known = {str(file).encode("ascii", "backslashreplace").decode(): str(file) for file in files}
    found = next((frame for frame in _FRAME.finditer(text) if frame["file"] in known), None)
    return None if found is None else Location(known[found["file"]], int(found["line"]))
