"""The number of runs that a worker gets at a time: one, or a batch of short ones, which share their start."""

from __future__ import annotations

from collections import deque
from collections.abc import Hashable, Iterable, Sequence
from typing import Final

_LONGEST_S: Final = 3.0
"""The time that a batch may take: so late may its outcomes come, and so much work may be lost with a worker."""

_SHORTEST_S: Final = 0.3
"""The time that is not worth another start, even if a worker then waits for others at the end."""

_MOST_RUNS: Final = 16
_PARTS: Final = 2
"""A batch is at most this part of what is left for each thread: the workers end at the same time."""


class Batches:
    """The runs that wait for a worker."""

    def __init__(self, waiting: Iterable[int], kinds: Sequence[Hashable | None]) -> None:
        """Take the indices of runs, and the kind of each run: equal kinds may share a batch, None is always alone."""
        self._waiting = deque(waiting)
        self._kinds = kinds
        self._alone: set[int] = set()
        # Nothing is known of the first runs.
        self._seconds = _LONGEST_S

    def __len__(self) -> int:
        return len(self._waiting)

    def take(self, threads: int) -> tuple[int, ...]:
        """Return the next runs for one of so many threads of workers."""
        fair = max(len(self._waiting) // (_PARTS * max(1, threads)), int(_SHORTEST_S / self._seconds))
        most = min(_MOST_RUNS, int(_LONGEST_S / self._seconds), fair)
        taken = [self._waiting.popleft()]
        kind = self._kind(taken[0])
        while kind is not None and len(taken) < most and self._waiting and self._kind(self._waiting[0]) == kind:
            taken.append(self._waiting.popleft())
        return tuple(taken)

    def _kind(self, index: int) -> Hashable | None:
        return None if index in self._alone else self._kinds[index]

    def took(self, seconds: Sequence[float]) -> None:
        """Take the times of the runs of a batch, which tell how long others will be."""
        self._seconds = max(1e-3, sum(seconds) / len(seconds))

    def put_back(self, indices: Sequence[int]) -> None:
        """Take runs that must start again, before all others."""
        self._waiting.extendleft(reversed(indices))

    def put_back_alone(self, indices: Sequence[int]) -> None:
        """Take runs of a batch that has no result: one of them may be the reason, and each gets a task of its own."""
        self._alone.update(indices)
        self.put_back(indices)

    def put_last(self, index: int) -> None:
        """Take a run that must start again, after all others."""
        self._waiting.append(index)

    def clear(self) -> tuple[int, ...]:
        """Return all runs; none waits any more."""
        left = tuple(self._waiting)
        self._waiting.clear()
        return left
