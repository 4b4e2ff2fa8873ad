"""Signals as columns over time, read off a trace."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from sim_action.assertions.temporal_logic.formula import Signal
from sim_action.core.units import TIME_EPSILON
from sim_action.state.trace import FloatArray, Trace


@dataclass(frozen=True, eq=False)
class Samples:
    """What signals were at T moments, in SI units.

    Attributes:
        signals: S of them, each once.
        rows: (T, 1 + S), time and then the signals.
    """

    signals: tuple[Signal, ...]
    rows: FloatArray

    def __len__(self) -> int:
        return len(self.rows)

    @classmethod
    def of(cls, trace: Trace, signals: tuple[Signal, ...], start_xy: tuple[float, float]) -> Self:
        """The samples of a trace; `start_xy` in m is where travel counts from."""
        columns = [trace.time, *(_column(trace, signal, start_xy) for signal in signals)]
        return cls(signals, np.column_stack(columns))

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """Samples of the same signals, one after the other."""
        first, *others = parts
        return first if not others else replace(first, rows=np.concatenate([part.rows for part in parts]))

    @property
    def time(self) -> FloatArray:
        """(T,) s, rising."""
        return self.rows[:, 0]

    def of_signal(self, signal: Signal) -> FloatArray:
        """(T,) of one signal."""
        return self.rows[:, 1 + self.signals.index(signal)]

    def between(self, first: int, last: int) -> Self:
        """The moments from index `first` to before `last`."""
        return replace(self, rows=self.rows[first:last])

    def at_or_after(self, time: float | FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.intp]]:
        """The index of the first moment at or after a time, or (N,) of them."""
        return np.asarray(np.searchsorted(self.time, np.asarray(time) - TIME_EPSILON), dtype=np.intp)

    def after(self, time: float | FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.intp]]:
        """The index of the first moment after a time, or (N,) of them."""
        return np.asarray(np.searchsorted(self.time, np.asarray(time) + TIME_EPSILON), dtype=np.intp)


def _column(trace: Trace, signal: Signal, start_xy: tuple[float, float]) -> FloatArray:
    if signal.joint:
        columns: FloatArray = getattr(trace, f"joint_{signal.name}")
        return columns[:, trace.joint_names.index(signal.joint)]
    match signal.name:
        case "x" | "y" | "z":
            return trace.base_position_xyz[:, "xyz".index(signal.name)]
        case "travel":
            return trace.planar_distance_to(*start_xy)
        case "roll" | "pitch":
            return _rolled_or_pitched(trace, signal.name)
        case _:
            found: FloatArray = getattr(trace, signal.name)
            return found


def _rolled_or_pitched(trace: Trace, name: str) -> FloatArray:
    """(T,) rad, as URDF turns: first about x (roll), then about y (pitch), then about z of the world."""
    x, y, z, w = trace.base_orientation_xyzw.T
    if name == "roll":
        return np.asarray(np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), dtype=np.float64)
    return np.asarray(np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0)), dtype=np.float64)
