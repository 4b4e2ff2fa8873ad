"""The fold of what a sensor tells against bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Final, Self

import numpy as np

from sim_action.assertions import State
from sim_action.assertions.fold import Goal, Invariant
from sim_action.core import units
from sim_action.state.readings import READING_COLUMNS
from sim_action.state.trace_records import SensorRecord
from sim_action.state.verdict import Signal, Verdict

if TYPE_CHECKING:
    from sim_action.state.trace import FloatArray, Trace

_AXES: Final = "xyzw"


@dataclass(frozen=True, slots=True)
class SensorMonitor:
    """Folds the margin to the nearer of both bounds.

    Attributes:
        sensor, reading, which: what is read.
        what: the same, for people.
        once: whether one reading is enough.
        value: what was read at the moment that the fold is about.
        unit: SI symbol; known once something was read.
    """

    is_momentary: ClassVar[bool] = True

    sensor: str
    reading: str
    which: str | None
    what: str
    at_least: float | None
    at_most: float | None
    once: bool
    fold: Goal | Invariant | None = None
    value: float = 0.0
    unit: str = ""

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return self._fold.state

    @property
    def _fold(self) -> Goal | Invariant:
        return self.fold or (Goal() if self.once else Invariant())

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        record = trace.sensors.get(self.sensor)
        if record is None or not len(record):
            return self
        values = picked(record.columns[self.reading], self.which)
        fold = self._fold.observe(record.time, self._margin(values))
        if fold is self._fold:
            return self
        value = float(values[int((record.time == fold.time).argmax())])
        return replace(self, fold=fold, value=value, unit=self._unit_of(record))

    def _margin(self, values: FloatArray) -> FloatArray:
        margin = np.full(len(values), math.inf)
        # A bound that was not asked for is no infinite one: the value may be infinite, too.
        if self.at_least is not None:
            margin = np.minimum(margin, values - self.at_least)
        if self.at_most is not None:
            margin = np.minimum(margin, self.at_most - values)
        return margin

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Drawn.signals: at the sensor's own rate; nothing where a reading is infinite."""
        record = trace.sensors.get(self.sensor)
        if record is None or not len(record):
            return ()
        values = picked(record.columns[self.reading], self.which)
        finite = np.where(np.isfinite(values), values, np.nan)
        return (Signal(self.what, self._unit_of(record), record.time, finite, self.at_least, self.at_most),)

    def _unit_of(self, record: SensorRecord) -> str:
        return READING_COLUMNS[record.kind][self.reading].dimension.si

    def verdict(self) -> Verdict:
        """Measured is what was read at the moment that decides; None if it is infinite."""
        fold, passed = self._fold, self.state is State.HOLDS
        limit, side = self._nearer_bound()
        if fold.time is None or fold.margin is None:
            return Verdict(passed, None, limit, None, self.unit, None, f"{self.what}: nothing was read")
        value, bound = units.display_apart(self.value, limit, self.unit)
        holds = f"{self.what} was {value} at {fold.time:.2f} s"
        message = {
            (True, True): holds,
            (True, False): f"{holds} at the nearest, never within its bounds; {side} {bound}",
            (False, True): f"{holds}, {'lowest' if side == 'at least' else 'highest'}; {side} {bound}",
            (False, False): f"{holds}, {'less' if side == 'at least' else 'more'} than {bound}",
        }[self.once, passed]
        measured, margin = (number if math.isfinite(number) else None for number in (self.value, fold.margin))
        return Verdict(passed, measured, limit, margin, self.unit, fold.time, message)

    def _nearer_bound(self) -> tuple[float, str]:
        """The bound that the value is nearer to, or farther beyond."""
        if self.at_most is None or (
            self.at_least is not None and self.value - self.at_least < self.at_most - self.value
        ):
            assert self.at_least is not None, "one of both is given"
            return self.at_least, "at least"
        return self.at_most, "at most"


def picked(column: Any, which: str | None) -> FloatArray:
    """(N,) a number of each reading, from a column (N,) or (N, ...)."""
    values = np.asarray(column, dtype=np.float64)
    if which is None:
        return values
    rows = values.reshape(len(values), -1)
    if which in _AXES:
        return rows[:, _AXES.index(which)]
    if which == "norm":
        return np.asarray(np.sqrt((rows * rows).sum(axis=1)), dtype=np.float64)
    if which == "mean":
        return np.array([_mean(row) for row in rows])
    return np.asarray(rows.min(axis=1) if which == "min" else rows.max(axis=1), dtype=np.float64)


def _mean(row: FloatArray) -> float:
    finite = row[np.isfinite(row)]
    return float(finite.mean()) if len(finite) else math.inf
