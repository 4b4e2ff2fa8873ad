"""The process between the caller's and that of a scenario with code of the user's: it ends what that leaves behind.

All that descends from it falls to it (`reaper`). And a script that signals its parent, or the group of its parent,
ends its own scenario only: the scenario's process has a group of its own, and so has this one.

It ends as the scenario's process ended, with the same exit code or by the same signal; SIGTERM asks it to end all. That
it is not `sim_action.runner.child_main` itself keeps it small: no engine and no arrays are imported here.
"""

from __future__ import annotations

import os
import resource
import signal
import sys
import traceback
from contextlib import suppress
from typing import NoReturn

from sim_action.runner.isolation.process_control import (
    AWAITED_SIGNALS,
    become_subreaper,
    end_descendants,
    exit_as,
    impose_limits,
    wait_for_child,
)

assert sys.platform == "linux"


def main() -> NoReturn:
    """The entry of a fresh interpreter: the job comes on standard input, the progress descriptor as the argument."""
    progress = int(sys.argv[1])
    become_subreaper()
    worker = os.fork()
    if worker == 0:
        _work(progress)
    status = wait_for_child(worker)
    _report(progress, left=end_descendants(worker))
    exit_as(status)


def _work(progress: int) -> NoReturn:
    """Becomes the scenario's process; never returns into this module."""
    try:
        os.setpgid(0, 0)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, AWAITED_SIGNALS)
        from sim_action.runner.child_main import leave, received_job, run_job, turn_to

        job = received_job()
        turn_to(job)
        impose_limits(job.loaded.scenario.memory_bytes)
        run_job(job, progress)
        leave()
    except BaseException:  # noqa: BLE001 - nothing may return into the supervisor's code
        traceback.print_exc()
    finally:
        os._exit(1)


def _report(progress: int, left: int) -> None:
    """Tells the caller what `linux.LinuxChild` takes in: how many were left, and the most memory of any, in bytes."""
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss << 10
    with suppress(OSError):
        os.set_blocking(progress, False)
        os.write(progress, f"end {left} {peak}\n".encode())


if __name__ == "__main__":
    main()
