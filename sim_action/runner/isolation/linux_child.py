"""Child processes on Linux: with resource limits, and with an end for all processes that they leave behind.

Without user code, the child process is a fork of this process and has no children. With user code, and for repeated
runs, it is a `supervisor` whose child runs the scenario: forks of one process would share state that may differ.
"""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Final, NoReturn, Self

from typing_extensions import override

from sim_action.runner.child_files import ChildFiles
from sim_action.runner.child_main import become_child, run_job
from sim_action.runner.isolation import memory_files, process_control
from sim_action.runner.isolation.child_process import (
    REFUSED,
    ChildProcess,
    Former,
    Starter,
    former_files,
    job_environment,
    remove,
    scratch_folder,
)
from sim_action.runner.job import Job
from sim_action.runner.process_output import flush_output

assert sys.platform == "linux"

# The time for a supervisor to end all descendants; a busy machine needs long.
_ENDING_TIMEOUT_S: Final = 5.0
_ENDING_POLL_S: Final = 0.001


class LinuxChild(ChildProcess):
    """A running child process, the leader of its own session and group."""

    forks = True
    limits_memory = True
    # Its progress and its files.
    descriptors = 4

    def __init__(
        self,
        job: Job,
        pid: int,
        progress: int,
        files: memory_files.MemoryFiles,
        scratch: tempfile.TemporaryDirectory[str],
        *,
        former: Former,
        supervised: bool,
    ) -> None:
        super().__init__(job, progress, former)
        self._progress = progress
        self._pid = pid
        self._files = files
        self._scratch = scratch
        self._supervised = supervised

    @classmethod
    def start(cls, job: Job) -> Self:
        """Fork this process, or start a fresh interpreter for user code, for repeats, or if this process has threads.

        Raises OSError.
        """
        former = former_files(job)
        with files_of_child() as (scratch, files), ExitStack() as undone:
            reader, writer = os.pipe()
            undone.callback(os.close, reader)
            try:
                os.set_blocking(reader, False)
                # The child process must not wait for a caller that does not read.
                os.set_blocking(writer, False)
                of_others = job.loaded.scenario.runs_user_code or job.hash_seed is not None
                alone = of_others or threading.active_count() > 1
                pid = _spawn(job, files, writer) if alone else fork(partial(run_in_fork, job), job, files, writer)
            finally:
                os.close(writer)
            # From here on `close` cleans up.
            undone.pop_all()
        return cls(job, pid, reader, files, scratch, former=former, supervised=alone)

    @classmethod
    @override
    def starter(cls, jobs: Sequence[Job]) -> Starter:
        # The module extends this class.
        from sim_action.runner.isolation.shared_child import SharingStarter

        return SharingStarter(jobs)

    def poll(self) -> int | None:
        """Return the exit status after the end (negative: the signal that ended it), else None.

        It is not reaped yet: until `close`, its number is not reused for another process.
        """
        ended = os.waitid(os.P_PID, self._pid, os.WEXITED | os.WNOHANG | os.WNOWAIT)
        if ended is None:
            return None
        return ended.si_status if ended.si_code == os.CLD_EXITED else -ended.si_status

    def kill(self) -> None:
        """End the child process, also one that is not yet the leader of its group."""
        if not self._supervised:
            os.kill(self._pid, signal.SIGKILL)
            return
        os.kill(self._pid, signal.SIGTERM)
        os.kill(self._pid, signal.SIGCONT)

    def close(self) -> None:
        """Clean up after its end: end the processes that it left behind."""
        if self._supervised:
            self._await_supervisor()
        else:
            self._kill_group()
        _, _, usage = os.wait4(self._pid, 0)
        if not self._supervised:
            self.peak_memory = usage.ru_maxrss << 10
        self.listen()
        os.close(self._progress)
        self.report = self._files.read()
        self._files.close()
        remove(self._scratch)

    @property
    def printed(self) -> int:
        """The size of the printed output in bytes."""
        return self._files.printed

    def _heard(self) -> bytes:
        return os.read(self._progress, 65536)

    def _take(self, line: bytes) -> None:
        if line.startswith(b"end "):
            self.left, self.peak_memory = map(int, line.split()[1:])
        else:
            super()._take(line)

    def _kill_group(self) -> None:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._pid, signal.SIGKILL)

    def _await_supervisor(self) -> None:
        patience = time.monotonic() + _ENDING_TIMEOUT_S
        while (status := self.poll()) is None and time.monotonic() < patience:
            time.sleep(_ENDING_POLL_S)
        if status is None or status == -signal.SIGKILL:
            # The supervisor may have been killed by a process that it should end.
            os.kill(self._pid, signal.SIGKILL)
            self._kill_session()

    def _kill_session(self) -> None:
        for process in process_control.processes():
            if process.session == self._pid != process.number:
                with suppress(ProcessLookupError, PermissionError):
                    os.kill(process.number, signal.SIGKILL)


@contextmanager
def files_of_child() -> Iterator[tuple[tempfile.TemporaryDirectory[str], memory_files.MemoryFiles]]:
    """Make the scratch folder and the files of a child process; an error in this context removes them.

    Raise OSError.
    """
    with ExitStack() as undone:
        scratch = scratch_folder()
        undone.callback(remove, scratch)
        files = memory_files.MemoryFiles(Path(scratch.name))
        undone.callback(files.close)
        yield scratch, files
        undone.pop_all()


def run_in_fork(job: Job, files: ChildFiles, writer: int) -> bool:
    """Run a job in a fork, see `run_job`."""
    # Python warns once at each line: a run, or a caller, that did so before must not hide it.
    with warnings.catch_warnings():
        return run_job(job, files, writer)


def fork(run: Callable[[ChildFiles, int], object], job: Job, files: memory_files.MemoryFiles, writer: int) -> int:
    """Fork this process, and call `run` in the child process with the limits of the job; return its number.

    `writer`: the descriptor for its progress. Raise OSError.
    """
    flush_output()
    # Existing objects are not garbage of the child: scanning them would take time and copy all their pages.
    gc.freeze()
    parent = os.getpid()
    try:
        pid = os.fork()
        if pid == 0:
            _child_main(run, job, files.inherited, writer, parent)
    finally:
        gc.unfreeze()
    return pid


def _child_main(
    run: Callable[[ChildFiles, int], object], job: Job, files: ChildFiles, writer: int, parent: int
) -> NoReturn:
    """Call `run` in the fork; never return into the parent's code."""
    code = 1
    try:
        process_control.end_with_parent(parent, signal.SIGKILL)
        signal.set_wakeup_fd(-1)
        os.setsid()
        memory_files.close_others(files)
        try:
            become_child(files, writer)
            process_control.impose_limits(job.loaded.scenario.memory_bytes)
        except OSError as error:
            os.write(writer, REFUSED + b"%d\n" % (error.errno or 0))
            os._exit(code)
        run(files, writer)
        code = 0
    except BaseException:  # noqa: BLE001 - nothing may return into the parent's code
        traceback.print_exc()
    finally:
        flush_output()
        os._exit(code)


def _spawn(job: Job, files: memory_files.MemoryFiles, writer: int) -> int:
    with memory_files.pickled((job, files.inherited)) as stdin:
        process = subprocess.Popen(  # noqa: S603 - this interpreter, and nothing from a scenario
            [
                sys.executable,
                "-P",
                "-m",
                "sim_action.runner.isolation.scenario_supervisor",
                str(writer),
                str(os.getpid()),
            ],
            stdin=stdin,
            stdout=subprocess.DEVNULL,
            stderr=files.output,
            pass_fds=(writer, *files.inherited.descriptors),
            start_new_session=True,
            env=job_environment(job),
        )
    # Popen must not wait for the process too; only its number is used from here on.
    process.returncode = 0
    return process.pid
