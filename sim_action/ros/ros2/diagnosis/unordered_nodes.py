"""Nodes that lock-step cannot order: those that wait by the wall clock, and those with callbacks on several threads.

Both are seen by which threads run. Threads of DDS, which are named so, run by the wall clock, and do not count.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from sim_action.ros.quiescence import WatchedThread

# The beginning of the names of threads of Fast DDS.
_OF_DDS: Final = "dds."
# Threads without a name also handle changes of the graph, which are rare during a run.
_MIN_WAKES: Final = 3
_MIN_SHARED: Final = 10


class UnorderedNodes:
    """Notices nodes of one run.

    Attributes:
        labels: id of a process -> the name of its node.
    """

    def __init__(self) -> None:
        self.labels: dict[int, str] = {}
        self._wakes = Counter[str]()
        self._shared = Counter[str]()

    def notice_wakes(self, threads: Iterable[WatchedThread]) -> Iterator[str]:
        """Take the threads that ran although nothing was sent to nodes; yield reasons why another run may differ."""
        for label in {label for thread in threads if (label := self._node_of(thread)) is not None}:
            self._wakes[label] += 1
            if self._wakes[label] == _MIN_WAKES:
                yield (
                    f"the node '{label}' ran although nothing was sent to it; it waits by the wall clock, for example "
                    "with time.sleep() or a timer of another clock than that of the node"
                )

    def notice_work(self, before: Mapping[WatchedThread, bytes], after: Mapping[WatchedThread, bytes]) -> Iterator[str]:
        """Take how long threads had run before and after a wait; yield reasons why another run may differ."""
        ran = (thread for thread, spent in after.items() if before.get(thread, spent) != spent)
        counts = Counter(label for thread in ran if (label := self._node_of(thread)) is not None)
        for label in (label for label, count in counts.items() if count > 1):
            self._shared[label] += 1
            if self._shared[label] == _MIN_SHARED:
                yield (
                    f"the node '{label}' handles messages on several threads, in no certain order; use an executor "
                    "with one thread"
                )

    def _node_of(self, thread: WatchedThread) -> str | None:
        label = self.labels.get(thread.pid)
        return None if label is None or thread.name.startswith(_OF_DDS) else label
