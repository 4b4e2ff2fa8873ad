"""Child processes on Linux: with resource limits, and with an end for all processes that they leave behind.

Without user code, the child process is a fork of this process and has no children. With user code, and for repeated
runs, it is a `supervisor` whose child runs the scenario: forks of one process would share state that may differ.

Many runs without user code share a child process, one after the other. A fork for each of many variations would take
longer than a short run: the kernel copies pages, and the engine makes its memory again. A shared child process inherits
all jobs, and its parent sends the index of the next one. Results are as in separate child processes: the parent reads
an outcome only if its run ended normally. If it did not (an error that memory, files or the process may have
caused, a crash, a hang, a limit), the child process ends. The run is then doubtful, unless it was the first one in its
process: it has to run again, in a child process of its own.
"""

from __future__ import annotations

import fcntl
import gc
import os
import pickle
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final, NoReturn, Self

from typing_extensions import override

from sim_action.engines import chosen
from sim_action.runner.child_main import become_child, run_job
from sim_action.runner.isolation import child_process, process_control
from sim_action.runner.job import (
    ENDED,
    ENDED_LAST,
    FORKED,
    LENGTH,
    MAX_OUTCOME_BYTES,
    MAX_OUTCOMES,
    MAX_OUTPUT_BYTES,
    MAX_STACK_DUMP_BYTES,
    ChildFiles,
    ChildReport,
    Job,
)
from sim_action.runner.process_output import flush_output, muted

assert sys.platform == "linux"

if TYPE_CHECKING:
    from sim_action.runner.isolation.preloaded_interpreter import PreloadedInterpreter

# A mapping of a file that is cut off would crash the process that reads it.
_SEALS: Final = fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | fcntl.F_SEAL_SEAL


class MemoryFiles:
    """The files of one child process in memory. `output`: descriptor for text; `inherited`: as the child has them."""

    def __init__(self, scratch: Path) -> None:
        """Make the files. Raise OSError."""
        made: list[int] = []
        try:
            outcome = os.memfd_create("outcome", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
            made.append(outcome)
            # The file is sparse: it takes only as much memory as is written.
            _reserve(outcome, MAX_OUTCOME_BYTES)
            fcntl.fcntl(outcome, fcntl.F_ADD_SEALS, _SEALS)
            for name in ("output", "stack dump"):
                made.append(os.memfd_create(name))
                # Each program that the script starts adds to the end.
                fcntl.fcntl(made[-1], fcntl.F_SETFL, os.O_APPEND)
        except OSError:
            _close(made)
            raise
        self._outcome, self.output, self._stack_dump = made
        self.inherited = ChildFiles(scratch, *made)
        self.memory_of_parent = 0  # the bytes that a forked child shares with its parent
        _OPEN.append(self)

    @property
    def printed(self) -> int:
        """The size of the printed output in bytes."""
        return os.fstat(self.output).st_size

    def read(self) -> ChildReport:
        """Return the content, within its limits, after the child process has ended."""
        # The last whole outcome; nothing if there is none.
        size, at, last = os.fstat(self._outcome).st_size, 0, (0, 0)
        for _ in range(MAX_OUTCOMES):
            head = os.pread(self._outcome, LENGTH.size, at)
            length = LENGTH.unpack(head)[0] if len(head) == LENGTH.size else 0
            at += LENGTH.size
            if not 0 < length <= size - at:
                break
            last = (length, at)
            at += length
        return ChildReport(
            os.pread(self._outcome, *last),
            _end_of(self.output, MAX_OUTPUT_BYTES),
            _end_of(self._stack_dump, MAX_STACK_DUMP_BYTES),
        )

    def empty(self) -> None:
        """Forget the outcome and the printed output of a run, before the same child process begins the next one."""
        os.pwrite(self._outcome, LENGTH.pack(0), 0)
        if self.printed:
            os.ftruncate(self.output, 0)

    def close(self) -> None:
        """Free the memory; the child process must have ended."""
        _OPEN.remove(self)
        _close(self.inherited.descriptors)


_OPEN: Final[list[MemoryFiles]] = []


def close_others(own: ChildFiles) -> None:
    """Close the files of other child processes in a forked one, which would keep them in memory until its end."""
    for files in [files for files in _OPEN if files.inherited is not own]:
        files.close()


@contextmanager
def pickled(value: object) -> Iterator[int]:
    """Pickle a value into memory, and give a descriptor at its start. Raise OSError."""
    descriptor = os.memfd_create("job")
    with os.fdopen(descriptor, "r+b") as file:
        pickle.dump(value, file)
        file.seek(0)
        yield descriptor


def _reserve(descriptor: int, size: int) -> None:
    limit, _ = resource.getrlimit(resource.RLIMIT_FSIZE)
    os.ftruncate(descriptor, size if limit == resource.RLIM_INFINITY else min(size, limit))


def _close(descriptors: Iterable[int]) -> None:
    for descriptor in descriptors:
        with suppress(OSError):
            os.close(descriptor)


def _end_of(descriptor: int, most: int) -> bytes:
    return os.pread(descriptor, most, max(0, os.fstat(descriptor).st_size - most))


# The time for a supervisor to end all descendants; a busy machine needs long.
_ENDING_TIMEOUT_S: Final = 5.0
_ENDING_POLL_S: Final = 0.001
MAX_RUNS: Final = 500  # the most runs of one shared child process: each of them may leave a few kilobytes behind
_MAX_ORDER_BYTES: Final = 32
# Later environments and engines have a fresh interpreter for each run: these stay in memory to the end of the call.
_MOST_INTERPRETERS: Final = 4


Spawn = Callable[[Job, MemoryFiles, int], "int | PreloadedInterpreter"]
"""Starts a supervisor for a job, its files and the descriptor for its progress; returns its number, or what forks it.
"""


class LinuxChild(child_process.ChildProcess):
    """A running child process, the leader of its own session and group."""

    forks = True
    limits_memory = True
    descriptors = 4  # its progress and its files

    def __init__(
        self,
        job: Job,
        process: int | PreloadedInterpreter,
        progress: int,
        files: MemoryFiles,
        scratch: tempfile.TemporaryDirectory[str],
        *,
        former: child_process.Former,
        supervised: bool,
    ) -> None:
        super().__init__(job, progress, former)
        self._progress = progress
        # 0: the interpreter has not forked the process yet, as far as known.
        self._pid = process if isinstance(process, int) else 0
        self._interpreter = None if isinstance(process, int) else process
        self._files = files
        self._scratch = scratch
        self._supervised = supervised

    @classmethod
    @override
    def start(cls, job: Job, spawn: Spawn | None = None) -> Self:
        """Fork, or `spawn` an interpreter for user code, for repeats, or if there are other threads. Raises OSError."""
        former = child_process.former_files(job)
        with files_of_child() as (scratch, files), ExitStack() as undone:
            reader, writer = os.pipe()
            undone.callback(os.close, reader)
            try:
                os.set_blocking(reader, False)
                # The child process must not wait for a caller that does not read.
                os.set_blocking(writer, False)
                of_others = job.loaded.scenario.runs_user_code or job.hash_seed is not None
                alone = of_others or threading.active_count() > 1
                spawn = spawn or _spawn
                process = spawn(job, files, writer) if alone else fork(partial(run_in_fork, job), job, files, writer)
            finally:
                os.close(writer)
            # From here on `close` cleans up.
            undone.pop_all()
        return cls(job, process, reader, files, scratch, former=former, supervised=alone)

    @classmethod
    @override
    def starter(cls, job: Callable[[int], Job]) -> child_process.Starter:
        return SharingStarter(job)

    def poll(self) -> int | None:
        """Return the exit status after the end (negative: a signal), else None; it is reaped by `close` alone."""
        if not self._pid:
            return 1 if self.silent else None
        ended = os.waitid(os.P_PID, self._pid, os.WEXITED | os.WNOHANG | os.WNOWAIT)
        if ended is None:
            return None
        return ended.si_status if ended.si_code == os.CLD_EXITED else -ended.si_status

    def kill(self) -> None:
        """End the child process, also one that is not yet the leader of its group."""
        if not self._supervised:
            os.kill(self._pid, signal.SIGKILL)
            return
        # End an interpreter that has not forked the process yet, until it is known whether it still has.
        if self._interpreter is not None and not self._pid:
            self._interpreter.close()
            patience = time.monotonic() + _ENDING_TIMEOUT_S
            while not (self._pid or self.silent) and time.monotonic() < patience:
                self.listen()
                time.sleep(_ENDING_POLL_S)
        if self._pid:
            os.kill(self._pid, signal.SIGTERM)
            os.kill(self._pid, signal.SIGCONT)

    def close(self) -> None:
        """Clean up after its end: end the processes that it left behind."""
        # The end of its interpreter says nothing about the scenario.
        self.is_doubtful = self.is_doubtful or not self._pid
        if self._pid:
            if self._supervised:
                self._await_supervisor()
            else:
                with suppress(ProcessLookupError, PermissionError):
                    os.killpg(self._pid, signal.SIGKILL)
            _, _, usage = os.wait4(self._pid, 0)
            if not self._supervised:
                self.peak_memory = max(0, (usage.ru_maxrss << 10) - self._files.memory_of_parent)
        self.listen()
        os.close(self._progress)
        self.report = self._files.read()
        self._files.close()
        child_process.remove(self._scratch)

    @property
    def printed(self) -> int:
        """The size of the printed output in bytes."""
        return self._files.printed

    def _heard(self) -> bytes:
        return os.read(self._progress, 65536)

    def _take(self, line: bytes) -> None:
        if line.startswith(b"end "):
            self.left, self.peak_memory = map(int, line.split()[1:])
        elif line.startswith(FORKED):
            # Later ones are of user code.
            self._pid = self._pid or int(line.removeprefix(FORKED))
        else:
            super()._take(line)

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
def files_of_child() -> Iterator[tuple[tempfile.TemporaryDirectory[str], MemoryFiles]]:
    """Make the scratch folder and files of a child process; remove them after an error in here. Raise OSError."""
    with ExitStack() as undone:
        scratch = child_process.scratch_folder()
        undone.callback(child_process.remove, scratch)
        files = MemoryFiles(Path(scratch.name))
        undone.callback(files.close)
        yield scratch, files
        undone.pop_all()


def run_in_fork(job: Job, files: ChildFiles, writer: int, *, is_first: bool = True) -> bool:
    """Run a job in a fork, see `run_job`."""
    # Python warns once at each line: a run, or a caller, that did so before must not hide it.
    with warnings.catch_warnings():
        return run_job(job, files, writer, is_first=is_first)


def fork(run: Callable[[ChildFiles, int], object], job: Job, files: MemoryFiles, writer: int) -> int:
    """Fork this process, and call `run` there with the limits of the job; return its number. Raise OSError."""
    flush_output()
    # Existing objects are not garbage of the child: scanning them would take time and copy all their pages.
    gc.freeze()
    parent = os.getpid()
    files.memory_of_parent = process_control.private_memory()
    try:
        pid = os.fork()
        if pid == 0:
            _child_main(run, job, files, writer, parent)
    finally:
        gc.unfreeze()
    return pid


def _child_main(
    run: Callable[[ChildFiles, int], object], job: Job, files: MemoryFiles, writer: int, parent: int
) -> NoReturn:
    """Call `run` in the fork; never return into the parent's code."""
    code = 1
    try:
        process_control.end_with_parent(parent, signal.SIGKILL)
        signal.set_wakeup_fd(-1)
        os.setsid()
        close_others(files.inherited)
        try:
            become_child(files.inherited, writer)
            process_control.impose_limits(job.loaded.scenario.memory_bytes, files.memory_of_parent)
        except OSError as error:
            os.write(writer, child_process.REFUSED + b"%d\n" % (error.errno or 0))
            os._exit(code)
        run(files.inherited, writer)
        code = 0
    except BaseException:  # noqa: BLE001 - nothing may return into the parent's code
        traceback.print_exc()
    finally:
        flush_output()
        os._exit(code)


def _spawn(job: Job, files: MemoryFiles, writer: int) -> int:
    with pickled((job, files.inherited)) as stdin:
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
            env=child_process.job_environment(job),
        )
    # Popen must not wait for the process too; only its number is used from here on.
    process.returncode = 0
    return process.pid


class SharedChild(LinuxChild):
    """One run in a child process that may have run others before."""

    def __init__(
        self,
        job: Job,
        pid: int,
        channel: int,
        files: MemoryFiles,
        scratch: tempfile.TemporaryDirectory[str],
        *,
        former: child_process.Former,
        is_first: bool,
        rest: Callable[[SharedChild], None],
    ) -> None:
        super().__init__(job, pid, channel, files, scratch, former=former, supervised=False)
        self._is_first = is_first
        self._rest = rest
        self._ended: bytes | None = None

    @staticmethod
    def start_first(
        job_of: Callable[[int], Job], index: int, job: Job, rest: Callable[[SharedChild], None]
    ) -> SharedChild:
        """Fork this process for a job, and later ones of `job_of`; `rest` takes it when it waits. Raise OSError."""
        former = child_process.former_files(job)
        with files_of_child() as (scratch, files):
            # A child that is not shared needs none.
            import socket

            ours, others = socket.socketpair()
            with ours, others:
                ours.setblocking(False)
                # The child process must not wait for a caller that does not read.
                others.setblocking(False)
                pid = fork(partial(_serve, job_of, index), job, files, others.fileno())
                channel = ours.detach()
        return SharedChild(job, pid, channel, files, scratch, former=former, is_first=True, rest=rest)

    def next(self, index: int, job: Job) -> SharedChild:
        """Hand the next job to the waiting child process. Raise OSError if it has gone."""
        former = child_process.former_files(job)
        self._files.empty()
        os.write(self._progress, b"%d\n" % index)
        return SharedChild(
            job, self._pid, self._progress, self._files, self._scratch, former=former, is_first=False, rest=self._rest
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


class SharingStarter(child_process.Starter):
    """Hands a job to a child process that waits for one, or starts a new child process."""

    def __init__(self, job_of: Callable[[int], Job]) -> None:
        """Take the function that returns a job by its index; child processes inherit it."""
        super().__init__(LinuxChild)
        self._job_of = job_of
        self._waiting: list[SharedChild] = []
        # Environment and engine -> what serves all scenarios with them.
        self._interpreters: dict[object, PreloadedInterpreter] = {}
        self._preloads = True

    @override
    def start(self, index: int, job: Job, *, alone: bool, most_waiting: int) -> child_process.ChildProcess:
        if alone or not _may_share(job) or threading.active_count() > 1:
            self._end_children(most_waiting)
            is_preloaded = self._preloads and not alone and job.hash_seed is None
            return LinuxChild.start(job, self._preloaded if is_preloaded else None)
        while (child := self._take_waiting(_kind(job))) is not None:
            try:
                return child.next(index, job)
            except (OSError, MemoryError):
                # It has died while it was waiting, or this process lacks memory for a moment.
                child.end()
        self._end_children(most_waiting)
        return SharedChild.start_first(self._job_of, index, job, self._waiting.append)

    @override
    def end_waiting(self) -> None:
        self._end_children()
        self._end_interpreters()

    def _end_children(self, most: int = 0) -> None:
        while len(self._waiting) > most:
            self._waiting.pop(0).end()

    def _end_interpreters(self) -> None:
        while self._interpreters:
            self._interpreters.popitem()[1].close()

    def _preloaded(self, job: Job, files: MemoryFiles, writer: int) -> int | PreloadedInterpreter:
        """Start a supervisor, as a fork of an interpreter with the environment and engine of the job if possible."""
        # Few calls have scenarios with user code.
        from sim_action.runner.isolation.preloaded_interpreter import PreloadedInterpreter

        environment = child_process.job_environment(job)
        engine = chosen(job.loaded.scenario.backend)
        kind = (frozenset(environment.items()), engine)
        if kind not in self._interpreters and len(self._interpreters) >= _MOST_INTERPRETERS:
            return _spawn(job, files, writer)
        try:
            if kind not in self._interpreters:
                self._interpreters[kind] = PreloadedInterpreter(environment, engine)
            with pickled((job, files.inherited)) as pickle_file:
                self._interpreters[kind].fork(pickle_file, writer, files.inherited.descriptors)
            return self._interpreters[kind]
        except OSError:
            # A script may have killed it, or it has threads.
            self._preloads = False
            self._end_interpreters()
            return _spawn(job, files, writer)

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


def _serve(job_of: Callable[[int], Job], index: int, files: ChildFiles, channel: int) -> None:
    """Run one job after the other, until one does not end normally, or this process has run enough of them."""
    for run in range(1, MAX_RUNS + 1):
        is_normal = run_in_fork(job_of(index), files, channel, is_first=run == 1)
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
