"""A process that ends all that descends from it: what the supervisor of a scenario and the keeper of a command share.

It is a "child subreaper" (Linux, prctl(2)): a process below it that loses its parent becomes its own child, also after
`setsid` and a double fork. Nothing that descends from it is left as soon as it has no child.
"""

from __future__ import annotations

import os
import resource
import signal
import sys
from contextlib import suppress
from typing import Final, NoReturn

from sim_action.runner.isolation import limits
from sim_action.runner.isolation.process_table import processes

assert sys.platform == "linux"

AWAITED: Final = (signal.SIGCHLD, signal.SIGTERM)
"""Blocked from `prepare` on; whoever forks a child unblocks them there."""

_PR_SET_DUMPABLE: Final = 4
_PR_SET_CHILD_SUBREAPER: Final = 36


def prepare() -> None:
    """Makes this process the one that its descendants fall to; SIGTERM, also of its parent's end, is only noted."""
    limits.prctl(_PR_SET_CHILD_SUBREAPER, 1)
    # A caller that is killed outright asks nobody to end anything.
    limits.prctl(limits.PR_SET_PDEATHSIG, signal.SIGTERM)
    # Ending by the signal of a crash is no second crash.
    limits.prctl(_PR_SET_DUMPABLE, 0)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_BLOCK, AWAITED)


def wait_for(worker: int) -> int:
    """The exit code of a child, or the negative number of the signal that ended it; SIGTERM's if asked to end it.

    The child is not reaped yet, so that its number cannot become another group's.
    """
    while signal.sigwait(AWAITED) != signal.SIGTERM:
        while ended := os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT):
            if ended.si_pid == worker:
                return ended.si_status if ended.si_code == os.CLD_EXITED else -ended.si_status
            os.waitpid(ended.si_pid, 0)
    return -signal.SIGTERM


def end_all(worker: int) -> int:
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


def end_as(status: int) -> NoReturn:
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
