"""The signals of a formula as columns over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np

from sim_action.assertions.temporal_logic.formula import Signal
from sim_action.core.records import dataclass, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.state.trace import FloatArray


@dataclass(frozen=True, eq=False)
class Samples:
    """The values of signals at T steps, in SI units.

    Attributes:
        signals: the S signals, each once.
        rows: (T, 1 + S), time and the signals.
    """

    signals: tuple[Signal, ...]
    rows: FloatArray

    def __len__(self) -> int:
        return len(self.rows)

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """Return consecutive samples of the same signals in one piece."""
        first, *others = parts
        return first if not others else replace(first, rows=np.concatenate([part.rows for part in parts]))

    @property
    def time(self) -> FloatArray:
        """Sim time, (T,) s, increasing."""
        return self.rows[:, 0]

    def of_signal(self, signal: Signal) -> FloatArray:
        """Return (T,) the values of one signal."""
        return self.rows[:, 1 + self.signals.index(signal)]

    def between(self, first: int, last: int) -> Self:
        """Return the samples from index `first` up to, not including, `last`."""
        return replace(self, rows=self.rows[first:last])

    def at_or_after(self, time: float | FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.intp]]:
        """Return the index of the first step at or after a time, or (N,) of them."""
        return np.asarray(np.searchsorted(self.time, np.asarray(time) - TIME_EPSILON_S), dtype=np.intp)

    def after(self, time: float | FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.intp]]:
        """Return the index of the first step after a time, or (N,) of them."""
        return np.asarray(np.searchsorted(self.time, np.asarray(time) + TIME_EPSILON_S), dtype=np.intp)
