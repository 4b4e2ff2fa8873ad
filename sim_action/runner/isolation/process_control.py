"""What Linux holds a scenario's process to, and all below it."""

from __future__ import annotations

import ctypes
import os
import resource
import signal
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple, NoReturn

assert sys.platform == "linux"

PR_SET_PDEATHSIG: Final = 1
"""Of Linux's sys/prctl.h, as are those that the supervisor needs."""


def prctl(option: int, value: int) -> None:
    """Sets an option of this process (prctl(2))."""
    ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


def impose_limits(memory: int) -> None:
    """Sets the limits of this process; `memory`: address space, in bytes."""
    # A parent that is killed outright cannot end its children.
    prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    _limit(resource.RLIMIT_AS, memory)
    # What it prints is bounded by the caller, who looks now and then; this holds while the caller is held up. A trace
    # was in memory before it becomes a file. The number of processes is not limited: RLIMIT_NPROC counts those of the
    # user, the rest of the job among them.
    _limit(resource.RLIMIT_FSIZE, memory)
    _limit(resource.RLIMIT_CORE, 0)


def _limit(kind: int, most: int) -> None:
    """Sets a limit of this process and all below it; a lower one that is there already stays."""
    _, hard = resource.getrlimit(kind)
    most = most if hard == resource.RLIM_INFINITY else min(most, hard)
    resource.setrlimit(kind, (most, most))


class Process(NamedTuple):
    """One process: its number, that of its parent, and that of its session."""

    number: int
    parent: int
    session: int


def processes() -> Iterator[Process]:
    """Those that can be seen, also those that have ended and are not reaped yet."""
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                stat = (folder / "stat").read_bytes()
            except OSError:
                continue
            # The name of the program comes before, in brackets, and may hold brackets itself.
            _state, parent, _group, session, *_ = stat[stat.rindex(b")") + 2 :].split()
            yield Process(int(folder.name), int(parent), int(session))


assert sys.platform == "linux"

AWAITED_SIGNALS: Final = (signal.SIGCHLD, signal.SIGTERM)
"""Blocked from `become_subreaper` on; whoever forks a child unblocks them there."""

_PR_SET_DUMPABLE: Final = 4
_PR_SET_CHILD_SUBREAPER: Final = 36


def become_subreaper() -> None:
    """Makes this process the one that its descendants fall to; SIGTERM, also of its parent's end, is only noted."""
    prctl(_PR_SET_CHILD_SUBREAPER, 1)
    # A caller that is killed outright asks nobody to end anything.
    prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    # Ending by the signal of a crash is no second crash.
    prctl(_PR_SET_DUMPABLE, 0)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_BLOCK, AWAITED_SIGNALS)


def wait_for_child(worker: int) -> int:
    """The exit code of a child, or the negative number of the signal that ended it; SIGTERM's if asked to end it.

    The child is not reaped yet, so that its number cannot become another group's.
    """
    while signal.sigwait(AWAITED_SIGNALS) != signal.SIGTERM:
        while ended := os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT):
            if ended.si_pid == worker:
                return ended.si_status if ended.si_code == os.CLD_EXITED else -ended.si_status
            os.waitpid(ended.si_pid, 0)
    return -signal.SIGTERM


def end_descendants(worker: int) -> int:
    """Kills whatever descends from this process; returns how many there were beside that child, which leads a group."""
    with suppress(ProcessLookupError):
        os.killpg(worker, signal.SIGKILL)
    with suppress(ProcessLookupError):
        os.kill(worker, signal.SIGKILL)
    ended = 0
    while True:
        try:
            reaped, _ = os.waitpid(-1, os.WNOHANG)
            if not reaped:
                _kill_children()
                reaped, _ = os.waitpid(-1, 0)
        except ChildProcessError:
            return ended
        ended += reaped != worker


def exit_as(status: int) -> NoReturn:
    """Ends this process with an exit code, or by a signal, whose negative number it is."""
    if status < 0:
        if -status not in (signal.SIGKILL, signal.SIGSTOP):
            signal.signal(-status, signal.SIG_DFL)
            signal.pthread_sigmask(signal.SIG_UNBLOCK, [-status])
        os.kill(os.getpid(), -status)
    os._exit(status if status >= 0 else 128 - status)


def _kill_children() -> None:
    for process in processes():
        if process.parent == os.getpid():
            with suppress(ProcessLookupError, PermissionError):
                os.kill(process.number, signal.SIGKILL)
