"""The process between the caller's and that of a scenario with code of the user's: it ends what that leaves behind.

It is a "child subreaper" (Linux, prctl(2)): a process below it that loses its parent becomes its own child, also after
`setsid` and a double fork. Nothing that descends from it is left as soon as it has no child. And a script that signals
its parent, or the group of its parent, ends its own scenario only: the scenario's process has a group of its own, and
so has this one.

It ends as the scenario's process ended, with the same exit code or by the same signal; SIGTERM asks it to end all. That
it is not `sim_action.worker` itself keeps it small: no engine and no arrays are imported here.
"""

from __future__ import annotations

import os
import resource
import signal
import sys
import traceback
from contextlib import suppress
from typing import Final, NoReturn

from sim_action.isolation import limits
from sim_action.isolation.process_table import processes

assert sys.platform == "linux"

_PR_SET_DUMPABLE: Final = 4
_PR_SET_CHILD_SUBREAPER: Final = 36

_AWAITED: Final = (signal.SIGCHLD, signal.SIGTERM)


def main() -> NoReturn:
    """The entry of a fresh interpreter: the job comes on standard input, the progress descriptor as the argument."""
    progress = int(sys.argv[1])
    _prepare()
    worker = os.fork()
    if worker == 0:
        _work(progress)
    status = _wait_for(worker)
    _report(progress, left=_end_all(worker))
    _end_as(status)


def _prepare() -> None:
    limits.prctl(_PR_SET_CHILD_SUBREAPER, 1)
    # A caller that is killed outright asks nobody to end anything.
    limits.prctl(limits.PR_SET_PDEATHSIG, signal.SIGTERM)
    # Ending by the signal of a crash is no second crash.
    limits.prctl(_PR_SET_DUMPABLE, 0)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_BLOCK, _AWAITED)


def _work(progress: int) -> NoReturn:
    """Becomes the scenario's process; never returns into this module."""
    try:
        os.setpgid(0, 0)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _AWAITED)
        from sim_action.worker import leave, received_job, run_job, turn_to

        job = received_job()
        turn_to(job)
        limits.impose(job.loaded.scenario.memory_bytes)
        run_job(job, progress)
        leave()
    except BaseException:  # noqa: BLE001 - nothing may return into the supervisor's code
        traceback.print_exc()
    finally:
        os._exit(1)


def _wait_for(worker: int) -> int:
    """The exit code of the worker, or the negative number of the signal that ended it; SIGTERM's if asked to end it.

    The worker is not reaped yet, so that its number cannot become another group's.
    """
    while signal.sigwait(_AWAITED) != signal.SIGTERM:
        while ended := os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT):
            if ended.si_pid == worker:
                return ended.si_status if ended.si_code == os.CLD_EXITED else -ended.si_status
            os.waitpid(ended.si_pid, 0)
    return -signal.SIGTERM


def _end_all(worker: int) -> int:
    """Kills whatever descends from this process; returns how many there were beside the worker."""
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


def _kill_children() -> None:
    for process in processes():
        if process.parent == os.getpid():
            with suppress(ProcessLookupError, PermissionError):
                os.kill(process.number, signal.SIGKILL)


def _report(progress: int, left: int) -> None:
    """Tells the caller what `linux.LinuxChild` takes in: how many were left, and the most memory of any, in bytes."""
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss << 10
    with suppress(OSError):
        os.set_blocking(progress, False)
        os.write(progress, f"end {left} {peak}\n".encode())


def _end_as(status: int) -> NoReturn:
    if status < 0:
        if -status not in (signal.SIGKILL, signal.SIGSTOP):
            signal.signal(-status, signal.SIG_DFL)
            signal.pthread_sigmask(signal.SIG_UNBLOCK, [-status])
        os.kill(os.getpid(), -status)
    os._exit(status if status >= 0 else 128 - status)


if __name__ == "__main__":
    main()
