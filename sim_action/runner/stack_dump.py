"""Where code of the user's was when the time of its scenario was up: noted by its own process, read by the caller's."""

from __future__ import annotations

import faulthandler
import re
import signal
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from sim_action.core.errors import Location

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
