"""Windows of time: of an expectation (`after`, `before`), of a goal that must last (`for`), of an operator (`stl`).

The operators of a formula slide their windows over all steps, see `robustness`; `monitor` judges them online.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, ClassVar, Final, Self

from typing_extensions import override

from sim_action.assertions.monitors import Monitor, State
from sim_action.assertions.monitors.bounds import Goal
from sim_action.core.lazy_numpy import FloatArray, NDArray, np
from sim_action.core.records import dataclass, delegated, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.state.timeline import waits
from sim_action.state.trace import Trace
from sim_action.state.verdict import Judged, Signal, Verdict

if TYPE_CHECKING:
    Indices = NDArray[np.intp]

_DIGITS: Final = 9  # sim time is step / rate: equal durations differ by rounding


@dataclass(frozen=True, slots=True)
class Window(Monitor):
    """A monitor that passes on the steps from `after` to `before` only. When it closes, a pending goal is judged."""

    monitor: Monitor
    after: float = 0.0  # after, before: in s of sim time; infinite: an event has not happened, or there is no end
    before: float = math.inf
    over: bool = False  # True if the window has closed
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
        if waits(self.after):
            return 0.0
        if self.over or self.monitor.is_decided:
            return self.after
        return self.before if math.isfinite(self.before) else max(self.after, self.monitor.needed_until)

    leaves: ClassVar[tuple[Monitor, ...]] = delegated("monitor.leaves")
    unmet_premises: ClassVar[tuple[str, ...]] = delegated("monitor.unmet_premises")

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
        return type(self)(monitor.observe(seen), self.after, self.before, over, self.steps.followed_by(seen.time))

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


@dataclass(frozen=True, slots=True)
class HoldTime:
    """A goal: a condition holds without interruption for a given time."""

    wanted: float
    # sim time in s since which the condition holds; None if it does not hold at the last step
    since: float | None = None
    goal: Goal = Goal()  # the fold of the duration. Its time is the end of the longest interval.

    state: ClassVar[State] = delegated("goal.state")

    @property
    def longest(self) -> float:
        """The longest duration so far in s; 0 if the condition never held."""
        return max(0.0, self.wanted + (-math.inf if self.goal.margin is None else self.goal.margin))

    @property
    def began(self) -> float:
        """Sim time in s at which the longest interval began. Meaningful only if there is one."""
        return (self.goal.time or 0.0) - self.longest

    def observe(self, time: FloatArray, holds: NDArray[np.bool_]) -> Self:
        """Return the fold after these steps; `time` in s and `holds`, each (T,)."""
        if not len(time):
            return self
        since = self._since(time, holds)
        margin = np.where(holds, np.round(time - since - self.wanted, _DIGITS) + 0.0, -math.inf)
        goal = self.goal.observe(time, margin)
        return replace(self, since=float(since[-1]) if holds[-1] else None, goal=goal)

    def lasting(self, time: FloatArray, holds: NDArray[np.bool_]) -> FloatArray:
        """Return (T,) s for which the condition has held at each step; 0 where it does not hold."""
        return np.where(holds, np.round(time - self._since(time, holds), _DIGITS), 0.0)

    def _since(self, time: FloatArray, holds: NDArray[np.bool_]) -> FloatArray:
        """Return (T,) s of sim time since which the condition holds, where it holds."""
        held_before = np.concatenate(([self.since is not None], holds[:-1]))
        begins = np.where(holds & ~held_before, time, -math.inf)
        first = begins[0] if self.since is None else self.since
        return np.asarray(np.maximum.accumulate(np.concatenate(([first], begins[1:]))), dtype=np.float64)


NOTHING_LEAST: Final = math.inf  # the minimum of an empty window


def least_of_windows(values: FloatArray, first: Indices, last: Indices) -> FloatArray:
    """Return (N,) the minimum of `values[first:last]` for N windows; +inf for an empty one. Runs in O(n log n).

    Two overlapping windows of a power of two cover each window. Their minima come from a sparse table by doubling, of
    which only one row is kept.
    """
    found = np.full(len(first), NOTHING_LEAST)
    length = last - first
    # The base-2 logarithm of the length, rounded down.
    level = np.frexp(length.astype(np.float64))[1] - 1
    row, width = values, 1
    for step in range(int(level.max(initial=-1)) + 1):
        here = (level == step) & (length > 0)
        found[here] = np.minimum(row[first[here]], row[last[here] - width])
        row, width = np.minimum(row[:-width], row[width:]), 2 * width
    return found


def greatest_of_windows(values: FloatArray, first: Indices, last: Indices) -> FloatArray:
    """Return (N,) the maximum of `values[first:last]` for N windows; -inf for an empty one."""
    return -least_of_windows(-values, first, last)


def until(before: FloatArray, then: FloatArray) -> FloatArray:
    """Return (T,) z with z[i] = max(then[i], min(before[i], z[i + 1])), and z[T] = -inf. Runs in O(n log n).

    Each step clips the value of the next one to [then, max(before, then)]. Two such clips are one clip again, so the
    clips of 1, 2, 4, ... steps are made by doubling.
    """
    lower, upper = then.copy(), np.maximum(before, then)
    width = 1
    while width < len(lower):
        near_low, near_high = lower[:-width], upper[:-width]
        lower[:-width], upper[:-width] = (
            np.clip(lower[width:], near_low, near_high),
            np.clip(upper[width:], near_low, near_high),
        )
        width *= 2
    return lower
