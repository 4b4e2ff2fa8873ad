"""The processes of a launch, read from /proc (Linux): nodes, tests, programs that start nodes, and if all are quiet.

Processes are quiet if every thread sleeps, and none has run between two looks at all of them. A write to a socket of
this machine wakes the reader before the write returns. So once all nodes wait, each of them has handled every message
that it was sent.
"""

from __future__ import annotations

import os
import resource
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cached_property
from pathlib import Path, PurePath
from typing import Final

_PROC: Final = Path("/proc")
_READ_BYTES: Final = 65536
_MAX_HEADER_BYTES: Final = 64
_RESULT: Final = b"--gtest_output=xml:"
_STAT_BYTES: Final = 1024
_ENDED: Final = (FileNotFoundError, ProcessLookupError)
# A process that has ended, and that its parent has not waited for, has no work left either.
_SLEEPING: Final = (b"S", b"I", b"Z")
# Wall time that nodes may compute between two ticks, and the wait at each tick once lock-step is lost.
MAX_SETTLE_S: Final = 10.0
_SETTLE_AFTER_LOSS_S: Final = 0.05
_BUSY_S: Final = 0.1  # wall time for which the work of busy processes is compared
# The time of looking at a thread without a pause, and one pause.
_BUSY_WAIT_S: Final = 2e-4
_NAP_S: Final = 5e-5
# The part of the time for which a busy process runs; one that waits runs for less than a thousandth.
_BUSY_PART: Final = 0.02
_NANOSECONDS: Final = 1e9
_OWN_LINKS: Final = 2  # /proc/PID/task has one link per thread, and two of its own: its name and its dot


class ChildProcesses:
    """The children of a process. Its files stay open, because they are read at every step."""

    def __init__(self, pid: int) -> None:
        self._tasks = f"/proc/{pid}/task"
        self._count = -1
        self._open: list[int] = []

    def look(self) -> frozenset[int]:
        """Return the ids of the current children, including ended ones that the parent has not waited for."""
        try:
            count = os.stat(self._tasks).st_nlink  # noqa: PTH116 - looked at thousands of times
            if count != self._count:
                for descriptor in self._open:
                    os.close(descriptor)
                self._open = []
                for thread in os.listdir(self._tasks):  # noqa: PTH208 - names are wanted
                    with suppress(OSError):
                        self._open.append(os.open(f"{self._tasks}/{thread}/children", os.O_RDONLY | os.O_CLOEXEC))
                self._count = count
            texts = [os.pread(descriptor, _READ_BYTES, 0) for descriptor in self._open]
        except OSError:
            self._count = -1
            return frozenset()
        return frozenset(int(word) for words in texts for word in words.split())


def children(pid: int) -> frozenset[int]:
    """Return the ids of the current children of a process."""
    pids: set[int] = set()
    with suppress(OSError):
        for thread in (_PROC / str(pid) / "task").iterdir():
            pids.update(map(int, (thread / "children").read_text().split()))
    return frozenset(pids)


def descendants(pid: int) -> frozenset[int]:
    """Return the ids of all current descendants of a process."""
    pids: set[int] = set()
    waiting = [pid]
    while waiting:
        new = children(waiting.pop()) - pids
        pids |= new
        waiting += new
    return frozenset(pids)


def command_line(pid: int) -> bytes:
    """Return the words of a command line, each with a NUL at its end; nothing for a process that has ended."""
    with suppress(OSError):
        return (_PROC / str(pid) / "cmdline").read_bytes()
    return b""


def has_ended(pid: int) -> bool:
    """Return True if a process has ended, and its parent has not noticed yet."""
    with suppress(OSError):
        # The name of the program comes first, in brackets, and may hold brackets itself.
        return (_PROC / str(pid) / "stat").read_bytes().rpartition(b")")[2].split()[0] == b"Z"
    return False


def rostest_result_path(pid: int) -> Path | None:
    """Return the path of the result file of a test process of rostest; None for other processes."""
    results = (word for word in command_line(pid).split(b"\0") if word.startswith(_RESULT))
    return next((Path(os.fsdecode(word.removeprefix(_RESULT))) for word in results), None)


def is_result_written(result: Path) -> bool:
    """Return True if a test has written its result. The file exists from the start, with only a header."""
    try:
        return result.stat().st_size > _MAX_HEADER_BYTES and b"</testsuite" in result.read_bytes()[-_MAX_HEADER_BYTES:]
    except OSError:
        return False


def process_name(pid: int) -> str:
    """Return a short name of a process: the first words of its command line."""
    words = command_line(pid).decode(errors="replace").split("\0")
    return " ".join(PurePath(word).name for word in words[:2] if word) or f"process {pid}"


class WatchedThread:
    """A thread, with its files, which stay open: opening takes ten reads. Raises OSError when the thread has ended."""

    def __init__(self, pid: int, tid: int) -> None:
        self.pid, self.tid = pid, tid
        self._stat = os.open(f"/proc/{pid}/task/{tid}/stat", os.O_RDONLY | os.O_CLOEXEC)
        try:
            self._schedstat = os.open(f"/proc/{pid}/task/{tid}/schedstat", os.O_RDONLY | os.O_CLOEXEC)
        except OSError:
            os.close(self._stat)
            raise

    @cached_property
    def name(self) -> str:
        """The name that the thread had at the first look."""
        return self.current_name()

    def current_name(self) -> str:
        """Return the name that the thread has given itself; empty if it has ended."""
        with suppress(OSError):
            return Path(f"/proc/{self.pid}/task/{self.tid}/comm").read_text(errors="replace").strip()
        return ""

    def is_asleep(self) -> bool:
        """Return True if the thread waits for something. Raises OSError when it has ended."""
        # The name of the program comes first, in brackets, and may hold any characters.
        return os.pread(self._stat, _STAT_BYTES, 0).rpartition(b") ")[2][:1] in _SLEEPING

    def ran(self) -> bytes:
        """Return how long and how often the thread has run, as text. Raises OSError when it has ended."""
        return os.pread(self._schedstat, _STAT_BYTES, 0)

    def close(self) -> None:
        """Close the files."""
        os.close(self._stat)
        os.close(self._schedstat)
        # Another file may get the numbers.
        self._stat = self._schedstat = -1


class WatchedProcesses:
    """The processes to wait for, but not our thread `spared`; `at_rest`: threads -> how often each had run then.

    `is_kept`: True as long as `settle` has waited for all of them.
    """

    def __init__(self, spared: int) -> None:
        _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
        self._spared = spared
        self._threads: dict[int, dict[int, WatchedThread]] = {}
        self.at_rest: Mapping[WatchedThread, bytes] = {}
        self.is_kept = True

    def watch(self, pids: Iterable[int]) -> None:
        """Watch exactly these processes from now on."""
        watched = set(pids)
        for pid in set(self._threads) - watched:
            self._forget(pid)
        for pid in watched - set(self._threads):
            self._threads[pid] = {}

    def wait(self, patience: float) -> bool:
        """Wait until all processes wait. Return False if that takes longer than `patience` seconds."""
        deadline = time.monotonic() + patience
        while not self._is_quiet(deadline):
            if time.monotonic() > deadline:
                return False
        return True

    def settle(self) -> bool:
        """Wait until all processes wait. Return False if that takes too long; after that, it waits only a moment."""
        return self.wait(MAX_SETTLE_S if self.is_kept else _SETTLE_AFTER_LOSS_S)

    def loss(self, seconds: float, names_of: Callable[[frozenset[int]], Iterable[str]]) -> Iterator[str]:
        """Yield the message for lock-step that is lost at a sim time in s, the first time; `names_of`: of processes."""
        if self.is_kept:
            self.is_kept = False
            names = sorted(set(names_of(self.busy(_BUSY_S) - {os.getpid()})))
            who = f"{' and '.join(names)} {'were' if len(names) > 1 else 'was'}" if names else "nodes were"
            when = f"lock-step was lost at {seconds:g} s of sim time"
            yield f"{when}: {who} still busy after {MAX_SETTLE_S:g} s of wall time"

    def stirred(self) -> dict[WatchedThread, int]:
        """Return the threads that ran since all processes waited last, although nothing was sent, and how often."""
        runs: dict[WatchedThread, int] = {}
        for thread, ran in self.at_rest.items():
            with suppress(OSError):
                if (now := thread.ran()) != ran:
                    runs[thread] = _runs(now) - _runs(ran)
        return runs

    def busy(self, seconds: float) -> frozenset[int]:
        """Return the processes that run for a notable part of `seconds` of wall time, or else all awake processes.

        On a machine with too much load, a process that never sleeps may hardly run.
        """
        before = dict(self._run_times())
        time.sleep(seconds)
        least, after = _BUSY_PART * seconds * _NANOSECONDS, list(self._run_times())
        pids = frozenset(thread.pid for thread, ran in after if ran - before.get(thread, 0) >= least)
        return pids or frozenset(thread.pid for thread, _ in after if _is_awake(thread))

    def awakenings(self) -> dict[int, int]:
        """Return how often processes ran since the last `wait` found all quiet: id -> runs of its busiest thread."""
        runs: dict[int, int] = {}
        for thread, count in self.stirred().items():
            runs[thread.pid] = max(runs.get(thread.pid, 0), count)
        return runs

    def _run_times(self) -> Iterable[tuple[WatchedThread, int]]:
        for thread in [thread for pid in tuple(self._threads) for thread in self._threads_of(pid)]:
            with suppress(OSError):
                yield thread, int(thread.ran().split()[0])

    def _is_quiet(self, deadline: float) -> bool:
        """Return True if no thread ran while all were looked at. If one runs, wait until it sleeps and return False.

        A thread that sleeps at the second look, and has not run since the first, slept in between: it would have had to
        run in order to fall asleep. So there was a moment, between the last of the first looks and the first of the
        second looks, at which all threads slept, and at that moment there were no other threads.
        """
        threads = [thread for pid in tuple(self._threads) for thread in self._threads_of(pid)]
        thread = None
        try:
            before: list[bytes] = []
            for thread in threads:
                before.append(thread.ran())  # noqa: PERF401 - the except block needs the thread
            if not all(map(self._knows_all_of, tuple(self._threads))):
                return False
            for thread, ran in zip(threads, before, strict=True):
                if not thread.is_asleep() or thread.ran() != ran:
                    _wait_for(thread, deadline)
                    return False
        except OSError:
            assert thread is not None
            self._forget_thread(thread)
            return False
        self.at_rest = dict(zip(threads, before, strict=True))
        return True

    def _threads_of(self, pid: int) -> Iterable[WatchedThread]:
        """Return the current threads of a process."""
        if not self._knows_all_of(pid):
            try:
                tids = {int(name) for name in os.listdir(f"/proc/{pid}/task")} - {self._spared}  # noqa: PTH208 - strings
                threads = self._threads[pid]
                for tid in set(threads) - tids:
                    self._forget_thread(threads[tid])
                for tid in tids - set(threads):
                    with suppress(*_ENDED):
                        threads[tid] = WatchedThread(pid, tid)
            except _ENDED:
                self._forget(pid)
                return ()
        return tuple(self._threads[pid].values())

    def _knows_all_of(self, pid: int) -> bool:
        """Return True if the process has as many threads as are known."""
        try:
            entries = os.stat(f"/proc/{pid}/task").st_nlink  # noqa: PTH116 - looked at thousands of times
        except OSError:
            return False
        return entries == _OWN_LINKS + len(self._threads[pid]) + (pid == os.getpid())

    def _forget_thread(self, thread: WatchedThread) -> None:
        self._threads[thread.pid].pop(thread.tid).close()

    def _forget(self, pid: int) -> None:
        for thread in self._threads.pop(pid).values():
            thread.close()


def _is_awake(thread: WatchedThread) -> bool:
    try:
        return not thread.is_asleep()
    except OSError:
        return False


def _runs(ran: bytes) -> int:
    return int(ran.split()[2])


def _wait_for(thread: WatchedThread, deadline: float) -> None:
    """Wait until the thread sleeps; the others need no look before that. Raises OSError when it has ended."""
    began = time.monotonic()
    while not thread.is_asleep() and (now := time.monotonic()) < deadline:
        # Most threads sleep soon. A nap leaves the processor to the others; after a yield, this one might wait long.
        if now - began > _BUSY_WAIT_S:
            time.sleep(_NAP_S)
