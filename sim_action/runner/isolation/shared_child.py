"""Child processes on Linux that run scenarios without user code, one after the other.

A fork for each of many variations would take longer than a short run: the kernel copies pages, and the engine makes its
memory again. A shared child process inherits the list of all jobs, and its parent sends the index of the next one.

Results are those of child processes of their own. The parent reads an outcome only if its run ended normally. If it did
not (an error that memory, files or the process may have caused, a crash, a hang, a limit), the child process ends. The
run is then doubtful, unless it was the first one in its process: it has to run again, in a child process of its own.
"""

from __future__ import annotations

import gc
import os
import socket
import sys
import tempfile
import threading
from collections.abc import Callable, Sequence
from functools import partial
from typing import Final

from typing_extensions import override

from sim_action.runner.child_files import ChildFiles
from sim_action.runner.isolation import linux_child, memory_files, process_control
from sim_action.runner.isolation.child_process import (
    ChildProcess,
    Former,
    Starter,
    former_files,
)
from sim_action.runner.job import ENDED, ENDED_LAST, Job
from sim_action.runner.process_output import flush_output, muted

assert sys.platform == "linux"

MAX_RUNS: Final = 100
"""The most runs of one child process: whatever they leave behind stays bounded."""

_MAX_ORDER_BYTES: Final = 32


class SharedChild(linux_child.LinuxChild):
    """One run in a child process that may have run others before."""

    def __init__(
        self,
        job: Job,
        pid: int,
        channel: int,
        files: memory_files.MemoryFiles,
        scratch: tempfile.TemporaryDirectory[str],
        *,
        former: Former,
        is_first: bool,
        rest: Callable[[SharedChild], None],
    ) -> None:
        super().__init__(job, pid, channel, files, scratch, former=former, supervised=False)
        self._is_first = is_first
        self._rest = rest
        self._ended: bytes | None = None

    @staticmethod
    def start_first(jobs: Sequence[Job], index: int, job: Job, rest: Callable[[SharedChild], None]) -> SharedChild:
        """Fork this process for a job, and for others of `jobs` later; `rest` takes it when it waits for one.

        Raise OSError.
        """
        former = former_files(job)
        with linux_child.files_of_child() as (scratch, files):
            ours, others = socket.socketpair()
            with ours, others:
                ours.setblocking(False)
                # The child process must not wait for a caller that does not read.
                others.setblocking(False)
                pid = linux_child.fork(partial(_serve, jobs, index), job, files, others.fileno())
                channel = ours.detach()
        return SharedChild(job, pid, channel, files, scratch, former=former, is_first=True, rest=rest)

    def next(self, index: int, job: Job) -> SharedChild:
        """Hand the next job to the waiting child process. Raise OSError if it has gone."""
        former = former_files(job)
        self._files.empty()
        os.write(self._progress, b"%d\n" % index)
        return SharedChild(
            job,
            self._pid,
            self._progress,
            self._files,
            self._scratch,
            former=former,
            is_first=False,
            rest=self._rest,
        )

    def poll(self) -> int | None:
        """Return 0 after a normal end of the run; else see `LinuxChild.poll`."""
        return 0 if self._ended is not None else super().poll()

    def close(self) -> None:
        """Read the report; end the child process if it takes no other job."""
        if self._ended == ENDED:
            self.report = self._files.read()
            self._rest(self)
            return
        self.is_doubtful = self._ended is None and not self._is_first
        super().close()

    def end(self) -> None:
        """End the child process while it waits for a job."""
        self.kill()
        super().close()

    def _heard(self) -> bytes:
        try:
            return super()._heard()
        except ConnectionResetError:
            # It died before it read its order.
            return b""

    def _take(self, line: bytes) -> None:
        if line in (ENDED, ENDED_LAST):
            self._ended = line
        else:
            super()._take(line)


class SharingStarter(Starter):
    """Hands a job to a child process that waits for one, or starts a new child process."""

    def __init__(self, jobs: Sequence[Job]) -> None:
        """Take all jobs; child processes inherit them."""
        super().__init__(linux_child.LinuxChild)
        self._jobs = jobs
        self._waiting: list[SharedChild] = []

    @override
    def start(self, index: int, job: Job, *, alone: bool, most_waiting: int) -> ChildProcess:
        if alone or not _may_share(job) or threading.active_count() > 1:
            self.end_waiting(most_waiting)
            return super().start(index, job, alone=alone, most_waiting=most_waiting)
        while (child := self._take_waiting(_kind(job))) is not None:
            try:
                return child.next(index, job)
            except (OSError, MemoryError):
                # It has died while it was waiting, or this process lacks memory for a moment.
                child.end()
        self.end_waiting(most_waiting)
        return SharedChild.start_first(self._jobs, index, job, self._waiting.append)

    @override
    def end_waiting(self, most: int = 0) -> None:
        while len(self._waiting) > most:
            self._waiting.pop(0).end()

    def _take_waiting(self, kind: object) -> SharedChild | None:
        for position, child in enumerate(self._waiting):
            if _kind(child.job) == kind:
                return self._waiting.pop(position)
        return None


def _may_share(job: Job) -> bool:
    loaded = job.loaded
    return job.hash_seed is None and not loaded.scenario.runs_user_code and not loaded.workspace.updates_golden


def _kind(job: Job) -> object:
    # Only the child process reads some models, with native code: they share it with runs of the same file only.
    own = job.loaded.file if job.loaded.model is None else None
    return job.loaded.scenario.memory_bytes, own


def _serve(jobs: Sequence[Job], index: int, files: ChildFiles, channel: int) -> None:
    """Run one job after the other, until one does not end normally, or this process has run enough of them."""
    for run in range(1, MAX_RUNS + 1):
        is_normal = linux_child.run_in_fork(jobs[index], files, channel)
        flush_output()
        if not is_normal:
            return
        # From here on this process waits, however long the caller takes.
        os.set_blocking(channel, True)
        os.write(channel, (ENDED if run < MAX_RUNS else ENDED_LAST) + b"\n")
        # Cycles of the run hold its engine, which belongs to no output of the next run.
        with muted():
            gc.collect()
        if run == MAX_RUNS or not (order := os.read(channel, _MAX_ORDER_BYTES)):
            return
        os.set_blocking(channel, False)
        index = int(order)
        if run == 1:
            # The first run, which is not repeated alone, must reach its memory limit where a run alone does.
            process_control.keep_freed_memory()
