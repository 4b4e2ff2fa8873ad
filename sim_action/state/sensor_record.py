"""What a sensor has told over time, as columns: the part of a trace that is its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sim_action.core.units import TIME_EPSILON
from sim_action.state.readings import Reading


@dataclass(frozen=True, eq=False)
class SensorRecord:
    """The readings of one sensor, at its own rate.

    Attributes:
        kind: of sensor, as scenarios name it.
        time: (N,) s, rising.
        columns: name -> (N, ...) numbers; see the kind's reading.
    """

    kind: str
    time: NDArray[np.float64]
    columns: Mapping[str, NDArray[Any]]

    def __len__(self) -> int:
        return len(self.time)

    @classmethod
    def of_readings(cls, kind: str, readings: Sequence[Reading]) -> Self:
        """The record of at least one reading."""
        rows = [reading.columns() for reading in readings]
        columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
        return cls(kind, np.array([reading.time for reading in readings]), columns)

    @classmethod
    def concatenate(cls, records: Sequence[Self]) -> Self:
        """Records of the same sensor, one after the other."""
        columns = {name: np.concatenate([record.columns[name] for record in records]) for name in records[0].columns}
        return cls(records[0].kind, np.concatenate([record.time for record in records]), columns)

    def between(self, start: float, end: float) -> Self:
        """The readings with start <= time <= end."""
        first, last = np.searchsorted(self.time, (start - TIME_EPSILON, end + TIME_EPSILON))
        columns = {name: column[first:last] for name, column in self.columns.items()}
        return type(self)(self.kind, self.time[first:last], columns)
