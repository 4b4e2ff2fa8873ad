"""The time window of an expectation, wrapped around the monitor of an assertion."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Self

from typing_extensions import override

from sim_action.assertions.monitors import Monitor, State
from sim_action.core.records import dataclass, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.state.verdict import Judged, Signal

if TYPE_CHECKING:
    from sim_action.state.trace import Trace
    from sim_action.state.verdict import Verdict


@dataclass(frozen=True, slots=True)
class Window(Monitor):
    """A monitor that passes on the steps from `after` to `before` only. When it closes, a pending goal is judged.

    Attributes:
        after: begin of the window, in s of sim time.
        before: end of the window, in s of sim time; infinite if there is none.
        over: True if the window has closed.
        steps: the steps that were passed on.
    """

    monitor: Monitor
    after: float = 0.0
    before: float = math.inf
    over: bool = False
    steps: Judged = Judged()

    @property
    @override
    def state(self) -> State:
        state = self.monitor.state
        if not self.over or state is not State.PENDING:
            return state
        return State.BROKEN if self.verdict().status == "failed" else State.HOLDS

    @property
    def needed_until(self) -> float:
        """See Monitor.needed_until. Nothing is needed after the window, or if no later step can matter."""
        if self.over or self.monitor.is_decided:
            return self.after
        return self.before if math.isfinite(self.before) else max(self.after, self.monitor.needed_until)

    @property
    @override
    def unmet_premises(self) -> tuple[str, ...]:
        return self.monitor.unmet_premises

    @override
    def observe(self, trace: Trace) -> Self:
        if self.over or not len(trace):
            return self
        monitor = self.monitor
        if trace.time[0] <= self.after + TIME_EPSILON_S:
            monitor = monitor.begin(trace.between(-math.inf, self.after))
        seen = trace.between(self.after, self.before)
        over = bool(trace.time[-1] >= self.before - TIME_EPSILON_S)
        # `replace` would take longer than many a monitor.
        return type(self)(monitor.observe(seen), self.after, self.before, over, counted(self.steps, seen))

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """Return the curves of the monitor over a whole run. Cumulative quantities begin where the window opens."""
        monitor = self.monitor.begin(trace.between(-math.inf, self.after))
        seen = trace if monitor.is_momentary else trace.between(self.after, self.before)
        if not len(seen):
            return ()
        end = min(self.before, float(trace.time[-1]))
        return tuple(signal.within(self.after, end) for signal in monitor.signals(seen))

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
