"""The time window of an expectation, wrapped around the monitor of an assertion."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Self

from sim_action.assertions.monitors import (
    Monitor,
    State,
    is_cumulative,
    is_decided,
    is_plottable,
    needed_until,
    unmet_premises,
)
from sim_action.core.records import dataclass, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.state.verdict import Judged, Signal

if TYPE_CHECKING:
    from sim_action.state.trace import Trace
    from sim_action.state.verdict import Verdict


@dataclass(frozen=True, slots=True)
class Window:
    """A monitor that passes on the steps from `after` to `before` only. When it closes, a pending goal is judged.

    Attributes:
        after: begin of the window, in s of sim time.
        before: end of the window, in s of sim time; infinite if there is none.
        over: True if the window has closed.
        began: the state of the monitor before the first step.
        steps: the steps that were passed on.
    """

    monitor: Monitor
    after: float = 0.0
    before: float = math.inf
    over: bool = False
    began: State = State.HOLDS
    steps: Judged = Judged()

    @classmethod
    def of(cls, monitor: Monitor, after: float, before: float) -> Self:
        """Return the window around a monitor that has seen no step."""
        return cls(monitor, after, before, began=monitor.state)

    @property
    def state(self) -> State:
        """See Monitor.state."""
        state = self.monitor.state
        if not self.over or state is not State.PENDING:
            return state
        return State.BROKEN if self.verdict().status == "failed" else State.HOLDS

    @property
    def needed_until(self) -> float:
        """See BoundedMonitor.needed_until. Nothing is needed after the window, or if no later step can matter."""
        if self.over or is_decided(self.monitor, self.began):
            return self.after
        return self.before if math.isfinite(self.before) else max(self.after, needed_until(self.monitor))

    @property
    def unmet_premises(self) -> tuple[str, ...]:
        """See ConditionalMonitor.unmet_premises."""
        return unmet_premises(self.monitor)

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        if self.over or not len(trace):
            return self
        monitor = self.monitor
        if trace.time[0] <= self.after + TIME_EPSILON_S and is_cumulative(monitor):
            monitor = monitor.begin(trace.between(-math.inf, self.after))
        seen = trace.between(self.after, self.before)
        over = bool(trace.time[-1] >= self.before - TIME_EPSILON_S)
        # `replace` would take longer than many a monitor.
        return type(self)(monitor.observe(seen), self.after, self.before, over, self.began, counted(self.steps, seen))

    def verdict(self) -> Verdict:
        """Return the verdict of the monitor with the moments at which it was judged."""
        verdict = self.monitor.verdict().counted(self.steps)
        if self.steps.moments or verdict.status != "not_exercised":
            return verdict
        message = f"never checked: the run ended before {self.after:g} s (after); run for longer, or lower 'after'"
        return replace(verdict, message=message)


def counted(steps: Judged, trace: Trace) -> Judged:
    """Return the steps so far and those of `trace`."""
    time = trace.time
    if not len(time):
        return steps
    first = float(time[0]) if steps.first is None else steps.first
    return Judged(steps.moments + len(time), first, float(time[-1]))


def signals_of(monitor: Monitor, trace: Trace, after: float, before: float) -> tuple[Signal, ...]:
    """Return the curves of a monitor over a whole run. Cumulative quantities begin where the window opens."""
    if is_cumulative(monitor):
        monitor = monitor.begin(trace.between(-math.inf, after))
    if not is_plottable(monitor):
        return ()
    seen = trace if monitor.is_momentary else trace.between(after, before)
    if not len(seen):
        return ()
    end = min(before, float(trace.time[-1]))
    return tuple(signal.within(after, end) for signal in monitor.signals(seen))
