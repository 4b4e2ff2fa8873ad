"""A trace that grows: all that was seen so far in one piece, at any time, without copying it each time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np

from sim_action.state.trace import FloatArray, Trace

# Of rows, more than what is there: whatever the length of a run, a row is copied once or twice.
_ROOM: Final = 2


@dataclass(slots=True, eq=False)
class _Rows:
    """Room for rows, the first `filled` of which are written, and never again."""

    rows: FloatArray
    filled: int

    def added(self, count: int, rows: FloatArray) -> _Rows:
        """These, with more behind the first `count`; others, if those behind them are another future's."""
        end = count + len(rows)
        store = self
        if self.filled != count or end > len(self.rows):
            store = _Rows(np.empty((_ROOM * end, self.rows.shape[1])), count)
            store.rows[:count] = self.rows[:count]
        store.rows[count:end] = rows
        store.filled = end
        return store


@dataclass(frozen=True, slots=True, eq=False)
class History:
    """A trace so far. Its state is not copied; what stands beside it, such as contacts, is joined anew each time.

    Attributes:
        beside: a trace without moments.
    """

    _store: _Rows
    _count: int
    beside: Trace

    @classmethod
    def of(cls, trace: Trace) -> Self:
        """The history that begins with these moments."""
        store = _Rows(np.empty((0, trace.state.shape[1])), 0)
        return cls(store.added(0, trace.state), len(trace), trace.rows(slice(0)))

    def followed_by(self, trace: Trace) -> Self:
        """The history after the moments that follow; this one stays as it is."""
        beside = Trace.concatenate((self.beside, trace.rows(slice(0))))
        store = self._store.added(self._count, trace.state)
        return replace(self, _store=store, _count=self._count + len(trace), beside=beside)

    def whole(self) -> Trace:
        """All of it, whose state cannot be written to."""
        state = self._store.rows[: self._count]
        state.flags.writeable = False
        return replace(self.beside, state=state)
