"""Work added up over time: what the monitor of `energy` does."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from sim_action.assertions import State
from sim_action.assertions.bounds import Bounds
from sim_action.state.verdict import Signal

if TYPE_CHECKING:
    from sim_action.assertions.energy import Braking
    from sim_action.state.trace import FloatArray, Trace
    from sim_action.state.verdict import Verdict


@dataclass(frozen=True, slots=True)
class EnergyMonitor:
    """Carries the work so far, and the moment that it goes on from.

    Attributes:
        time: s of sim time.
        velocities: of the joints at that time, in rad/s or m/s.
        work: J.
    """

    is_momentary: ClassVar[bool] = False

    joints: tuple[str, ...]
    braking: Braking
    bounds: Bounds
    time: float
    velocities: tuple[float, ...]
    work: float = 0.0

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return self.bounds.state

    def begin(self, trace: Trace) -> Self:
        """See Follower.begin: the work until the window opens does not count."""
        if not len(trace):
            return self
        velocities = tuple(trace.joint_velocity[-1, self._columns(trace)].tolist())
        return replace(self, time=float(trace.time[-1]), velocities=velocities)

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        if not len(trace):
            return self
        work = self._work_until(trace)
        return replace(self.begin(trace), bounds=self.bounds.observe(trace.time, work), work=float(work[-1]))

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Drawn.signals."""
        return (self.bounds.drawn("work", trace.time, self._work_until(trace)),)

    def _work_until(self, trace: Trace) -> FloatArray:
        """(T,) J, up to each moment."""
        # The sum begins with what came before: added afterwards, it would round differently for every cut.
        work = np.cumsum(np.concatenate(([self.work], self._works(trace))))[1:]
        return np.asarray(work, dtype=np.float64)

    def verdict(self) -> Verdict:
        """See Monitor.verdict."""
        return self.bounds.verdict()

    def _works(self, trace: Trace) -> FloatArray:
        """(T,) J, of each step: its effort, times the way that the mean of the velocities about it makes."""
        columns = self._columns(trace)
        velocities = np.vstack((np.asarray(self.velocities), trace.joint_velocity[:, columns]))
        seconds = np.diff(trace.time, prepend=self.time)
        works = trace.joint_effort[:, columns] * (velocities[1:] + velocities[:-1]) / 2 * seconds[:, None]
        counted = {"free": np.clip(works, 0.0, None), "costs": np.abs(works), "regained": works}[self.braking]
        # One joint after the other, for the same reason.
        return np.asarray(np.cumsum(counted, axis=1)[:, -1], dtype=np.float64)

    def _columns(self, trace: Trace) -> list[int]:
        return [trace.joint_names.index(name) for name in self.joints]
