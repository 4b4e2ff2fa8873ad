"""The process between the caller and a scenario with user code: it ends all processes that the scenario leaves.

It adopts all its descendants (see `process_control`). A script that signals its parent, or the group of its parent,
ends only its own scenario: the scenario's process and this one have groups of their own.

It ends with the same exit code or signal as the scenario's process. SIGTERM makes it end all descendants. It starts in
an interpreter of its own, or as a fork of a `preloaded_interpreter`. In the first case it stays small, because it
imports `sim_action.runner.child_main`, with engine and numpy, only after its own fork.
"""

from __future__ import annotations

import os
import resource
import signal
import sys
import traceback
from collections.abc import Sequence
from contextlib import suppress
from typing import NoReturn

from sim_action.runner.isolation import process_control

assert sys.platform == "linux"


def main() -> NoReturn:
    """Run in a fresh interpreter: a job on standard input; arguments: progress descriptor, parent's number."""
    progress, parent = map(int, sys.argv[1:])
    supervise(progress, parent)


def supervise(progress: int, parent: int, descriptors: Sequence[int] = ()) -> NoReturn:
    """Be the supervisor of the job on standard input; `descriptors`: of the child's files here, or as in the caller."""
    process_control.become_subreaper(parent)
    supervisor = os.getpid()
    try:
        worker = os.fork()
    except OSError as error:
        # See `child_process.REFUSED`, whose module would import too much here.
        os.write(progress, b"refused %d\n" % (error.errno or 0))
        os._exit(1)
    if worker == 0:
        _work(progress, supervisor, descriptors)
    status = process_control.wait_for_child(worker)
    # Report to `LinuxChild` how many processes were left, and the most memory of any, in bytes.
    left = process_control.end_descendants(worker)
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss << 10
    with suppress(OSError):
        os.set_blocking(progress, False)
        os.write(progress, f"end {left} {peak}\n".encode())
    process_control.exit_as(status)


def _work(progress: int, supervisor: int, descriptors: Sequence[int]) -> NoReturn:
    """Become the scenario's process; never return."""
    try:
        process_control.end_with_parent(supervisor, signal.SIGKILL)
        os.setpgid(0, 0)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, process_control.AWAITED_SIGNALS)
        # only where it is asked for
        from sim_action.runner.child_main import become_child, exit_child, received_job, run_job

        job, files = received_job()
        if descriptors:
            files = type(files)(files.scratch, *descriptors)
        become_child(files, progress)
        process_control.impose_limits(job.loaded.scenario.memory_bytes)
        run_job(job, files, progress)
        exit_child()
    except BaseException:  # noqa: BLE001 - nothing may return into the supervisor's code
        traceback.print_exc()
    finally:
        os._exit(1)


if __name__ == "__main__":
    main()
