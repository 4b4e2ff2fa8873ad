"""The number of child processes that the limits of this process allow, and the reason why one cannot be started."""

from __future__ import annotations

import errno
import os
import sys
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final

from sim_action.runner.isolation.child_process import ChildProcess

# For the start of one more child process, and for imports, reports and recordings of this process.
_RESERVED_DESCRIPTORS: Final = 16
_RESERVED_TASKS: Final = 4


def most_children(child_type: type[ChildProcess], jobs: int) -> int:
    """Return how many child processes may run at the same time: `jobs`, or fewer if resource limits ask for it."""
    descriptors = (_free_descriptors() - _RESERVED_DESCRIPTORS) / child_type.descriptors
    tasks = (_free_tasks() - _RESERVED_TASKS) / child_type.tasks
    return max(1, int(min(jobs, descriptors, tasks)))


def cause_of(error: OSError | MemoryError) -> str:
    """Return why a child process cannot be started although no other one runs, and the way out, in plain words."""
    if isinstance(error, MemoryError):
        error = OSError(errno.ENOMEM, os.strerror(errno.ENOMEM))
    number = error.errno
    said = error.strerror or str(error)
    reason = f"{said[:1].lower()}{said[1:]}"
    if number in (errno.ENOSPC, getattr(errno, "EDQUOT", None)):
        return f"{reason}; free some space in {tempfile.gettempdir()}, or set TMPDIR to another folder"
    if number in _LIMITS:
        name, advice = _LIMITS[number]
        limit = _soft_limit(name)
        shown = "" if limit == float("inf") else f" ({name} is {limit:.0f})"
        return f"{reason}{shown}; {advice}"
    if number in _ADVICE:
        return f"{reason}; {_ADVICE[number]}"
    return reason if error.filename is None else f"{reason}: {error.filename}"


_LIMITS: Final[Mapping[int | None, tuple[str, str]]] = {
    errno.EMFILE: ("RLIMIT_NOFILE", 'raise this limit with "ulimit -n"'),
    errno.EAGAIN: ("RLIMIT_NPROC", 'end other processes of this user, or raise the limit with "ulimit -u"'),
}
_ADVICE: Final[Mapping[int | None, str]] = {
    errno.ENFILE: "this machine has too many open files: end other processes",
    errno.ENOMEM: "this machine has too little memory: end other processes, or use a machine with more memory",
}


def _soft_limit(name: str) -> float:
    """Return a resource limit of this process; infinity if it has none."""
    if sys.platform == "win32":
        return float("inf")
    import resource

    limit, _ = resource.getrlimit(getattr(resource, name))
    return float("inf") if limit == resource.RLIM_INFINITY else limit


def _free_descriptors() -> float:
    """Return how many more descriptors this process may open; infinity if this is not known."""
    for folder in ("/proc/self/fd", "/dev/fd"):
        with suppress(OSError):
            # One of them is open for this list alone.
            return _soft_limit("RLIMIT_NOFILE") - (len(list(Path(folder).iterdir())) - 1)
    return float("inf")


def _free_tasks() -> float:
    """Return how many more processes and threads this user may have; infinity if this is not limited or not known."""
    if sys.platform != "linux" or os.getuid() == 0:
        # Root has no such limit. Other systems do not list threads.
        return float("inf")
    limit = _soft_limit("RLIMIT_NPROC")
    if limit - _MANY_TASKS > _all_tasks():
        return _MANY_TASKS
    return limit - _tasks_of(os.getuid())


# With so many left for all users together, those of this user need not be counted: reading /proc takes time.
_MANY_TASKS: Final = 2048


def _all_tasks() -> float:
    """Return the number of all processes and threads of this machine."""
    try:
        return float(Path("/proc/loadavg").read_text("ascii").split()[3].partition("/")[2])
    except (OSError, ValueError, IndexError):
        return float("inf")


def _tasks_of(user: int) -> int:
    """Return the number of processes and threads of a user, as far as they are visible."""
    found = 0
    with suppress(OSError):
        for folder in Path("/proc").iterdir():
            # A process may end meanwhile.
            with suppress(OSError, ValueError, KeyError):
                if folder.name.isdigit():
                    lines = (folder / "status").read_text("utf-8", errors="replace").splitlines()
                    status = dict(line.partition(":")[::2] for line in lines)
                    found += int(status["Threads"]) if int(status["Uid"].split()[0]) == user else 0
    return found
