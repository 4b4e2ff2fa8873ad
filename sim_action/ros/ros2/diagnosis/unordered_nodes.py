"""Nodes that lock-step cannot order: those that wait by the wall clock, and those with callbacks on several threads.

Both are seen by which threads run. Threads of DDS, which are named so, run by the wall clock, and do not count. Nor
does the thread by which spdlog, the logger of ROS 2, writes its files every 5 s; it has no name.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from sim_action.ros.quiescence import WatchedThread

# The beginning of the names of threads of Fast DDS.
_OF_DDS: Final = "dds."
# Threads without a name also handle changes of the graph, which are rare during a run.
_MIN_WAKES: Final = 3
_MIN_SHARED: Final = 10
# In s of wall time: less than the period of spdlog.
_MAX_GAP_S: Final = 4.0


class UnorderedNodes:
    """Notices nodes of one run.

    Attributes:
        labels: id of a process -> the name of its node.
    """

    def __init__(self) -> None:
        self.labels: dict[int, str] = {}
        self._wakes, self._shared = _Repetitions(), _Repetitions()

    def notice_wakes(self, threads: Iterable[WatchedThread], now: float) -> Iterator[str]:
        """Take the threads that ran although nothing was sent to nodes; yield reasons why another run may differ.

        `now`: wall time in s.
        """
        woken = [thread for thread in threads if self._is_of_node(thread)]
        with_main = {thread.pid for thread in woken if thread.tid == thread.pid}
        for pid in {thread.pid for thread in woken}:
            if self._wakes.count(pid, now, is_frequent=pid in with_main) == _MIN_WAKES:
                yield (
                    f"the node '{self.labels[pid]}' ran although nothing was sent to it; it waits by the wall clock, "
                    "for example with time.sleep(), a timeout, or a timer of another clock than that of the node"
                )

    def notice_work(
        self, before: Mapping[WatchedThread, bytes], after: Mapping[WatchedThread, bytes], now: float
    ) -> Iterator[str]:
        """Take how long threads had run before and after a wait; yield reasons why another run may differ.

        `now`: wall time in s.
        """
        ran = (thread for thread, spent in after.items() if before.get(thread, spent) != spent)
        counts = Counter(thread.pid for thread in ran if self._is_of_node(thread))
        for pid in (pid for pid, count in counts.items() if count > 1):
            if self._shared.count(pid, now) == _MIN_SHARED:
                yield (
                    f"the node '{self.labels[pid]}' handles messages on several threads, in no certain order; use an "
                    "executor with one thread"
                )

    def _is_of_node(self, thread: WatchedThread) -> bool:
        return thread.pid in self.labels and not thread.name.startswith(_OF_DDS)


class _Repetitions:
    """Counts what happens to processes again soon after the last time."""

    def __init__(self) -> None:
        self._counts = Counter[int]()
        self._last: dict[int, float] = {}

    def count(self, pid: int, now: float, *, is_frequent: bool = False) -> int:
        """Count one more, and return the count; 0: it did not count. `is_frequent`: it counts in any case."""
        gap = now - self._last.get(pid, -math.inf)
        self._last[pid] = now
        if gap > _MAX_GAP_S and not is_frequent:
            return 0
        self._counts[pid] += 1
        return self._counts[pid]
