"""Several limits that must all hold, and the one to speak of."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

from sim_action.assertions import Monitor, State, is_drawn
from sim_action.assertions.fold import joined
from sim_action.state.verdict import Signal

if TYPE_CHECKING:
    from sim_action.state.trace import Trace
    from sim_action.state.verdict import Verdict


@dataclass(frozen=True, slots=True)
class Every:
    """The monitor of several."""

    monitors: tuple[Monitor, ...]

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return joined(*(monitor.state for monitor in self.monitors))

    @property
    def is_momentary(self) -> bool:
        """See Drawn.is_momentary."""
        return all(monitor.is_momentary for monitor in self.monitors if is_drawn(monitor))

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        return replace(self, monitors=tuple(monitor.observe(trace) for monitor in self.monitors))

    def verdict(self) -> Verdict:
        """The limit that was broken first, else the one that was come nearest to, as a part of it."""
        verdicts = [monitor.verdict() for monitor in self.monitors]
        nearest = min(verdicts, key=lambda v: (v.margin or 0.0) / (v.limit or 1.0))
        return min((v for v in verdicts if not v.passed), key=lambda v: v.time or 0.0, default=nearest)

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Drawn.signals: those of all."""
        return tuple(signal for monitor in self.monitors if is_drawn(monitor) for signal in monitor.signals(trace))
