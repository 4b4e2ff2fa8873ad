"""What Linux holds a scenario's process to, and all below it."""

from __future__ import annotations

import ctypes
import resource
import signal
import sys
from typing import Final

assert sys.platform == "linux"

PR_SET_PDEATHSIG: Final = 1
"""Of Linux's sys/prctl.h, as are those that the supervisor needs."""


def prctl(option: int, value: int) -> None:
    """Sets an option of this process (prctl(2))."""
    ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


def impose(memory: int) -> None:
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
