"""How long something was so without interruption: a goal."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Self

import numpy as np
from numpy.typing import NDArray

from sim_action.assertions import State
from sim_action.assertions.fold import Goal

if TYPE_CHECKING:
    from sim_action.state.trace import FloatArray

# Sim time is step / rate: the same span is not the same number everywhere.
_DIGITS: Final = 9


@dataclass(frozen=True, slots=True)
class Stretch:
    """The fold of how long a condition has held, until it has for as long as is wanted.

    Attributes:
        wanted: s.
        since: sim time in s from which it holds, at the last moment seen; None if it does not.
        goal: its margin is that of the longest stretch, its time that stretch's end.
    """

    wanted: float
    since: float | None = None
    goal: Goal = Goal()

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return self.goal.state

    @property
    def longest(self) -> float:
        """How long it held, in s; 0 if it never did."""
        return max(0.0, self.wanted + (-math.inf if self.goal.margin is None else self.goal.margin))

    @property
    def began(self) -> float:
        """When the longest stretch began, in s of sim time; it is meant for where there is one."""
        return (self.goal.time or 0.0) - self.longest

    def observe(self, time: FloatArray, holds: NDArray[np.bool_]) -> Self:
        """The fold after these moments, `holds` being (T,)."""
        if not len(time):
            return self
        since = self._since(time, holds)
        margin = np.where(holds, np.round(time - since - self.wanted, _DIGITS) + 0.0, -math.inf)
        goal = self.goal.observe(time, margin)
        return replace(self, since=float(since[-1]) if holds[-1] else None, goal=goal)

    def lasting(self, time: FloatArray, holds: NDArray[np.bool_]) -> FloatArray:
        """(T,) s that it has held at each of these moments; 0 where it does not."""
        return np.where(holds, np.round(time - self._since(time, holds), _DIGITS), 0.0)

    def _since(self, time: FloatArray, holds: NDArray[np.bool_]) -> FloatArray:
        """(T,) s of sim time from which it holds, where it does."""
        held_before = np.concatenate(([self.since is not None], holds[:-1]))
        begins = np.where(holds & ~held_before, time, -math.inf)
        first = begins[0] if self.since is None else self.since
        return np.asarray(np.maximum.accumulate(np.concatenate(([first], begins[1:]))), dtype=np.float64)
