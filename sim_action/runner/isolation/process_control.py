"""Control of processes on Linux: resource limits, the process table, and the end of all descendants.

`become_subreaper` makes a process a "child subreaper" (prctl(2)): a descendant that loses its parent becomes its own
child, even after `setsid` and a double fork. When it has no child left, no descendant is left.
"""

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

_PR_SET_PDEATHSIG: Final = 1  # a constant of Linux's sys/prctl.h, like those below


def prctl(option: int, value: int) -> None:
    """Set an option of this process (prctl(2))."""
    ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


def end_with_parent(parent: int, number: signal.Signals) -> None:
    """Let this process get a signal when its parent ends, in any way; at once if it has ended already."""
    prctl(_PR_SET_PDEATHSIG, number)
    if os.getppid() != parent:
        os.kill(os.getpid(), number)


def private_memory() -> int:
    """Return the bytes of this process that its forks have from the start: its resident pages of no file."""
    _, resident, of_files, *_ = Path("/proc/self/statm").read_text(encoding="ascii").split()
    return (int(resident) - int(of_files)) * resource.getpagesize()


def impose_limits(memory: int, inherited: int = 0) -> None:
    """Set the resource limits of this process; `memory`: address space in bytes, besides the `inherited` bytes."""
    _limit(resource.RLIMIT_AS, memory + inherited)
    # The caller also limits printed output, but only checks now and then. A trace was in memory before it becomes a
    # file. The number of processes is not limited: RLIMIT_NPROC counts all processes of the user.
    _limit(resource.RLIMIT_FSIZE, memory)
    _limit(resource.RLIMIT_CORE, 0)


def _limit(kind: int, most: int) -> None:
    _, hard = resource.getrlimit(kind)
    most = most if hard == resource.RLIM_INFINITY else min(most, hard)
    resource.setrlimit(kind, (most, most))


# Constants of glibc's malloc.h.
_M_TRIM_THRESHOLD: Final = -1
_M_MMAP_MAX: Final = -4


def keep_freed_memory() -> None:
    """Let glibc keep freed memory for the next run here: the kernel would make and clear the pages again."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_M_MMAP_MAX, 0)
        mallopt(_M_TRIM_THRESHOLD, 1 << 30)


class Process(NamedTuple):
    """The numbers of a process, its parent and its session."""

    number: int
    parent: int
    session: int


def processes() -> Iterator[Process]:
    """Yield all visible processes, also processes that have ended and are not reaped yet."""
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                stat = (folder / "stat").read_bytes()
            except OSError:
                continue
            # The program's name stands before, in brackets, and may contain brackets.
            _state, parent, _group, session, *_ = stat[stat.rindex(b")") + 2 :].split()
            yield Process(int(folder.name), int(parent), int(session))


AWAITED_SIGNALS: Final = (signal.SIGCHLD, signal.SIGTERM)
"""Blocked from `become_subreaper` on; a forked child must unblock them."""

_PR_SET_DUMPABLE: Final = 4
_PR_SET_CHILD_SUBREAPER: Final = 36


def become_subreaper(parent: int) -> None:
    """Make this process adopt its descendants; SIGTERM, also at its parent's end, is blocked and waits."""
    prctl(_PR_SET_CHILD_SUBREAPER, 1)
    # `exit_as` with the signal of a crash must not dump a second core.
    prctl(_PR_SET_DUMPABLE, 0)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_BLOCK, AWAITED_SIGNALS)
    end_with_parent(parent, signal.SIGTERM)


def wait_for_child(worker: int) -> int:
    """Return the exit code of a child (negative: a signal), or -SIGTERM if this process is to end; do not reap it."""
    while signal.sigwait(AWAITED_SIGNALS) != signal.SIGTERM:
        while ended := os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT):
            if ended.si_pid == worker:
                return ended.si_status if ended.si_code == os.CLD_EXITED else -ended.si_status
            os.waitpid(ended.si_pid, 0)
    return -signal.SIGTERM


def end_descendants(worker: int) -> int:
    """Kill all descendants; return their number without the child `worker`, which leads a group."""
    with suppress(ProcessLookupError):
        os.killpg(worker, signal.SIGKILL)
    with suppress(ProcessLookupError):
        os.kill(worker, signal.SIGKILL)
    ended = 0
    while True:
        try:
            reaped, _ = os.waitpid(-1, os.WNOHANG)
            if not reaped:
                for process in processes():
                    if process.parent == os.getpid():
                        with suppress(ProcessLookupError, PermissionError):
                            os.kill(process.number, signal.SIGKILL)
                reaped, _ = os.waitpid(-1, 0)
        except ChildProcessError:
            return ended
        ended += reaped != worker


def exit_as(status: int) -> NoReturn:
    """End this process with an exit code or, if it is negative, by that signal."""
    if status < 0:
        if -status not in (signal.SIGKILL, signal.SIGSTOP):
            signal.signal(-status, signal.SIG_DFL)
            signal.pthread_sigmask(signal.SIG_UNBLOCK, [-status])
        os.kill(os.getpid(), -status)
    os._exit(status if status >= 0 else 128 - status)
