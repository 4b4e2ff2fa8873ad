"""The signals of a formula as columns over time, read from a trace."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from sim_action.assertions.monitors.base_motion import BaseMotion
from sim_action.assertions.temporal_logic.formula import Signal
from sim_action.core.units import TIME_EPSILON_S
from sim_action.state.trace import FloatArray, Trace


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
    def of(cls, trace: Trace, signals: tuple[Signal, ...], start_xy: tuple[float, float], motion: BaseMotion) -> Self:
        """Return the samples of a trace; `start_xy` in m is the origin of `travel`, `motion` that before the trace."""
        columns = [trace.time, *(_column(trace, signal, start_xy, motion) for signal in signals)]
        return cls(signals, np.column_stack(columns))

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


def _column(trace: Trace, signal: Signal, start_xy: tuple[float, float], motion: BaseMotion) -> FloatArray:
    if signal.joint:
        columns: FloatArray = getattr(trace, f"joint_{signal.name}")
        return columns[:, trace.joint_names.index(signal.joint)]
    match signal.name:
        case "x" | "y" | "z":
            return trace.base_position_xyz[:, "xyz".index(signal.name)]
        case "travel":
            return trace.planar_distance_to(*start_xy)
        case "speed" | "turn_rate":
            return motion.speed(trace) if signal.name == "speed" else motion.turn_rate(trace)
        case "roll" | "pitch":
            return _rolled_or_pitched(trace, signal.name)
        case _:
            found: FloatArray = getattr(trace, signal.name)
            return found


def _rolled_or_pitched(trace: Trace, name: str) -> FloatArray:
    """Return (T,) rad in URDF's convention: roll about x, then pitch about y, then yaw about z of the world."""
    x, y, z, w = trace.base_orientation_xyzw.T
    if name == "roll":
        return np.asarray(np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), dtype=np.float64)
    return np.asarray(np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0)), dtype=np.float64)
