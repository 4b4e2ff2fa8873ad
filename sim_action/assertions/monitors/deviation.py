"""Deviations of a run from a reference: the error of each quantity against its tolerance."""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

from sim_action.core import units
from sim_action.core.records import dataclass, replace
from sim_action.state.golden_trajectory import wrapped

if TYPE_CHECKING:
    from sim_action.state.trace import FloatArray


@dataclass(frozen=True, slots=True)
class Tolerance:
    """The tolerance of one quantity.

    Attributes:
        what: "position", "heading" or the name of a joint.
        columns: the columns of a golden trajectory that make up the error.
        turns: True for angles that repeat after a full turn.
    """

    what: str
    unit: str
    limit: float
    columns: tuple[int, ...]
    turns: bool = False

    def errors(self, rows: FloatArray, golden: FloatArray) -> FloatArray:
        """Return (N,) errors in `unit` between rows with the same times."""
        import numpy as np

        difference = rows[:, self.columns] - golden[:, self.columns]
        difference = wrapped(difference) if self.turns else difference
        return np.asarray(np.sqrt(np.square(difference).sum(axis=1)), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Deviation:
    """The fold of the error of one quantity.

    Attributes:
        largest, time: the largest error and its sim time in s.
        left: sim time in s at which the error first exceeded the tolerance.
    """

    tolerance: Tolerance
    largest: float = -1.0
    time: float = 0.0
    left: float | None = None

    def observe(self, time: FloatArray, errors: FloatArray) -> Self:
        """Return the fold after these rows; `time` in s and `errors` in the unit of the tolerance, each (N,)."""
        later = self
        index = int(errors.argmax())
        if not errors[index] <= self.largest:  # NaN counts as an error
            later = replace(later, largest=float(errors[index]), time=float(time[index]))
        over = ~(errors <= self.tolerance.limit)
        if self.left is None and over.any():
            later = replace(later, left=float(time[int(over.argmax())]))
        return later

    @property
    def margin(self) -> float:
        """Margin of the largest error, in its unit."""
        return self.tolerance.limit - self.largest

    @property
    def text(self) -> str:
        """The largest error as text, such as "at most 5 cm off, at 3.40 s, limit 2 cm"."""
        tolerance = self.tolerance
        error, allowed = units.display_apart(self.largest, tolerance.limit, tolerance.unit)
        what = "" if tolerance.what == "position" else f" in {tolerance.what}"
        return f"at most {error} off{what}, at {self.time:.2f} s, limit {allowed}"
