"""Whether processes wait: every thread sleeps, and none has run between two looks (Linux, /proc).

A message that is written to a socket of this machine wakes whoever waits for it before the write is over. So once all
nodes wait, each has dealt with everything that it was sent.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterable
from contextlib import suppress
from typing import Final

_ROOM: Final = 1024
_SLEEPING: Final = (b"S", b"I")


class _Thread:
    """The files of one thread, which are kept open: to open them takes as long as to read them ten times."""

    def __init__(self, pid: int, tid: int) -> None:
        self.pid, self.tid = pid, tid
        self._stat, self._schedstat = (
            os.open(f"/proc/{pid}/task/{tid}/{name}", os.O_RDONLY | os.O_CLOEXEC) for name in ("stat", "schedstat")
        )

    def is_asleep(self) -> bool:
        """Whether it waits for something. Raises OSError when it is gone."""
        # Its name, in brackets, may hold anything.
        return os.pread(self._stat, _ROOM, 0).rpartition(b") ")[2][:1] in _SLEEPING

    def ran(self) -> bytes:
        """How long, and how often, until it slept last. Raises OSError when it is gone."""
        return os.pread(self._schedstat, _ROOM, 0)

    def close(self) -> None:
        """Lets go of the files."""
        os.close(self._stat)
        os.close(self._schedstat)


def _count(pid: int) -> int:
    """Goes up and down with its threads. Raises OSError when it is gone."""
    return os.stat(f"/proc/{pid}/task").st_nlink  # noqa: PTH116 - looked at thousands of times


class Watched:
    """Processes, by their ids; `spared`: a thread of ours that may run, since it is the one that looks."""

    def __init__(self, spared: int) -> None:
        self._spared = spared
        self._threads: dict[int, dict[int, _Thread]] = {}
        self._counts: dict[int, int] = {}

    def watch(self, pids: Iterable[int]) -> None:
        """From now on these processes and no others."""
        wanted = set(pids)
        for pid in set(self._threads) - wanted:
            self._forget(pid)
        for pid in wanted - set(self._threads):
            self._threads[pid] = {}
            self._counts[pid] = -1

    def wait(self, patience: float) -> bool:
        """Waits until all of them wait; False if that has taken longer than `patience` seconds."""
        deadline = time.monotonic() + patience
        while (busy := self._busy()) is not None:
            # Nobody else needs to be looked at while this one is.
            while self._is_busy(busy):
                if time.monotonic() > deadline:
                    return False
                # Lets it run where there is but one processor.
                os.sched_yield()
            if time.monotonic() > deadline:
                return False
        return True

    def _busy(self) -> _Thread | None:
        """A thread that runs, or has run while they were all looked at; None if there is none.

        A thread that is asleep the second time, and has not run since the first, was asleep all the while: otherwise
        it would have run in order to fall asleep. So there was a moment, between the last of the first looks and the
        first of the second, at which all of them were.
        """
        threads = [thread for pid in tuple(self._threads) for thread in self._threads_of(pid)]
        thread = None
        try:
            before: list[bytes] = []
            for thread in threads:
                before.append(thread.ran())
            if not all(map(self._is_counted, tuple(self._counts))):
                return thread
            for thread, ran in zip(threads, before, strict=True):
                if not thread.is_asleep() or thread.ran() != ran:
                    return thread
        except OSError:
            assert thread is not None
            self._forget_thread(thread)
            return thread
        return None

    def _is_busy(self, thread: _Thread) -> bool:
        try:
            return not thread.is_asleep()
        except OSError:
            return False

    def _threads_of(self, pid: int) -> Iterable[_Thread]:
        """Those that there are now."""
        try:
            count = _count(pid)
            if count != self._counts[pid]:
                self._find_threads(pid)
                self._counts[pid] = count
        except OSError:
            self._forget(pid)
            return ()
        return tuple(self._threads[pid].values())

    def _is_counted(self, pid: int) -> bool:
        """Whether it has as many threads as when they were listed, or is gone."""
        try:
            return _count(pid) == self._counts[pid]
        except OSError:
            return True

    def _find_threads(self, pid: int) -> None:
        found = {int(name) for name in os.listdir(f"/proc/{pid}/task")} - {self._spared}  # noqa: PTH208 - strings
        known = self._threads[pid]
        for tid in set(known) - found:
            self._forget_thread(known[tid])
        for tid in found - set(known):
            with suppress(OSError):
                known[tid] = _Thread(pid, tid)

    def _forget_thread(self, thread: _Thread) -> None:
        self._threads[thread.pid].pop(thread.tid).close()
        self._counts[thread.pid] = -1

    def _forget(self, pid: int) -> None:
        for thread in self._threads.pop(pid).values():
            thread.close()
        del self._counts[pid]
