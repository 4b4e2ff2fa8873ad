"""Guards around user code in the child process: it cannot use up all descriptors, and a call of `os._exit` is noted."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Final, NoReturn

_SPARE_DESCRIPTORS: Final = 64
_SPARE_SHARE: Final = 4  # of a low limit, at most one part in so many
_OURS: Final = str(Path(__file__).parent.parent / "_").removesuffix("_")


@contextmanager
def guarded(say: Callable[[bytes], None]) -> Iterator[None]:
    """Guard this process against user code that runs in this context; `say` sends a line to the parent."""
    with _spare_descriptors(), _noted_exits(say):
        yield


@contextmanager
def _spare_descriptors() -> Iterator[None]:
    """Lower the limit of open files in this context: after a leak, files can still be written and modules imported."""
    if sys.platform == "win32":
        yield
        return
    import resource

    limit, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if limit == resource.RLIM_INFINITY:
        yield
        return
    spare = min(_SPARE_DESCRIPTORS, limit // _SPARE_SHARE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (limit - spare, hard))
    try:
        yield
    finally:
        # User code may have changed it, too.
        now, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        wanted = now if now == resource.RLIM_INFINITY else now + spare
        resource.setrlimit(
            resource.RLIMIT_NOFILE, (wanted if hard == resource.RLIM_INFINITY else min(wanted, hard), hard)
        )


@contextmanager
def _noted_exits(say: Callable[[bytes], None]) -> Iterator[None]:
    """Send the line of user code that calls `os._exit` in this context, in this process."""
    leave, born = os._exit, os.getpid()

    def noted_exit(status: int) -> NoReturn:
        if os.getpid() == born:
            _say_caller(sys._getframe(1), say)  # noqa: SLF001 - as `inspect` does
        leave(status)

    setattr(os, "_exit", noted_exit)  # noqa: B010 - for mypy, it is constant
    try:
        yield
    finally:
        setattr(os, "_exit", leave)  # noqa: B010


def _say_caller(frame: FrameType, say: Callable[[bytes], None]) -> None:
    file = os.fsencode(frame.f_code.co_filename)
    if not file.startswith(os.fsencode(_OURS)) and b"\n" not in file:
        say(b"exit %d %s" % (frame.f_lineno, file))
