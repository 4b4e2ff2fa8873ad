"""The ticks at which a topic is published: its rate holds on average, also if it does not divide that of the ticks."""

from __future__ import annotations

import math
from typing import Self

from sim_action.core.records import dataclass

_EPSILON = 1e-9


@dataclass(frozen=True, slots=True)
class Schedule:
    """The ticks at which something is due.

    Attributes:
        rate: times per second, in Hz; at most `ticks`.
        ticks: ticks per second, in Hz.
    """

    rate: float
    ticks: float

    @classmethod
    def of(cls, rate: float, ticks: float) -> Self:
        """Return the schedule of a rate; 0, or more than there are ticks, means every tick."""
        return cls(rate if 0 < rate < ticks else ticks, ticks)

    def is_due(self, tick: int) -> bool:
        """Return True if it is due at a tick, counted from 0."""
        return tick == 0 or self._count(tick) != self._count(tick - 1)

    @property
    def is_even(self) -> bool:
        """True if all intervals are equal."""
        interval = self.ticks / self.rate
        return abs(interval - round(interval)) < _EPSILON

    def _count(self, tick: int) -> int:
        return math.floor(tick * self.rate / self.ticks + _EPSILON)
