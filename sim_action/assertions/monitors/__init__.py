"""Monitors: the part of an assertion that watches a run.

A monitor is a frozen value: `observe` returns the monitor after more physics steps. The simulation loop feeds it block
by block; a stored trace is fed in one piece. The verdict is the same.
"""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING, Any, Final, NamedTuple, Protocol, Self, TypeGuard, TypeVar

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from sim_action.state.trace import FloatArray, Trace
    from sim_action.state.verdict import Signal, Verdict

FORCE_WINDOW_S: Final = 0.05
"""The time over which reports average contact forces, and assertions, too, if a scenario states no other."""


class State(Enum):
    """The result of a monitor so far."""

    PENDING = "a goal that has not come true yet"
    HOLDS = "a goal that came true, or an invariant that is not broken so far"
    BROKEN = "it failed, and no later step can change that"


class Monitor(Protocol):
    """A fold over the physics steps of a run. It is frozen; `observe` returns its successor."""

    @property
    def state(self) -> State:
        """The result so far."""

    def observe(self, trace: Trace) -> Self:
        """Return the monitor after the steps of `trace`, which has every physics step."""

    def verdict(self) -> Verdict:
        """Return the verdict as if the run ended now."""


class CumulativeMonitor(Monitor, Protocol):
    """A monitor that accumulates from the previous step, so it must know where its time window begins."""

    def begin(self, trace: Trace) -> Self:
        """Return the monitor after the steps before the time window, including the step at which it opens."""


class DecidingMonitor(Monitor, Protocol):
    """A monitor that reports itself when it is decided.

    Any other goal is decided when it comes true, and any other invariant when it breaks.
    """

    @property
    def is_decided(self) -> bool:
        """True if no later step can change the result."""


class BoundedMonitor(Monitor, Protocol):
    """A monitor with a quantity over a finite time. It must see all of that time before a passing verdict is final."""

    @property
    def needed_until(self) -> float:
        """The sim time in s up to which the run must go on; 0 before the first step, and when it is decided.

        After the first step it never grows, so a run that may end stays one that may end.
        """


class ConditionalMonitor(Monitor, Protocol):
    """A monitor that may hold only because a premise never held."""

    @property
    def unmet_premises(self) -> tuple[str, ...]:
        """The premises that never held, as text."""


class PlottableMonitor(Monitor, Protocol):
    """A monitor that can return its signals as curves."""

    @property
    def is_momentary(self) -> bool:
        """True if each point of the curves depends on one step only. Such curves are valid outside the window."""

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """Return the curves that `observe(trace)` would judge. `trace` is not empty and may be decimated."""


class Truth(NamedTuple):
    """The truth of a condition: at each of (N,) s of sim time, rising, (N,) True or False."""

    time: FloatArray
    holds: NDArray[np.bool_]


class ConditionMonitor(Monitor, Protocol):
    """A monitor whose assertion is true or false at each moment."""

    def truth(self, trace: Trace) -> Truth:
        """Return the truth at the moments of `trace`, which follows the steps observed so far.

        The moments are the steps, or the readings of a sensor. Limits that must hold throughout count at each moment.
        """


class SampledMonitor(ConditionMonitor, Protocol):
    """A condition with moments between the steps: those of a sensor. The last one counts until the next one."""

    @property
    def is_sampled(self) -> bool:
        """True if it has such moments."""


AnyMonitor = TypeVar("AnyMonitor", bound=Monitor)


def has_truth(monitor: Monitor) -> TypeGuard[ConditionMonitor]:
    """Return True if the monitor has `truth`."""
    return hasattr(type(monitor), "truth")


def is_sampled(monitor: Monitor) -> bool:
    """Return True if the truth of the monitor has moments between the steps."""
    return bool(getattr(monitor, "is_sampled", False))


def is_cumulative(monitor: Monitor) -> TypeGuard[CumulativeMonitor]:
    """Return True if the monitor has `begin`. An isinstance check with the protocol would be much slower."""
    return hasattr(type(monitor), "begin")


def begun(monitor: AnyMonitor, trace: Trace) -> AnyMonitor:
    """Return the monitor after the steps before its window, if it is cumulative."""
    # A narrowed type would be that of the protocol alone.
    cumulative: Any = monitor
    return cumulative.begin(trace) if is_cumulative(monitor) else monitor


def is_deciding(monitor: Monitor) -> TypeGuard[DecidingMonitor]:
    """Return True if the monitor has `is_decided`."""
    return hasattr(type(monitor), "is_decided")


def is_decided(monitor: Monitor, began: State) -> bool:
    """Return True if no later step can change the result of a monitor that began in the state `began`."""
    if is_deciding(monitor):
        return monitor.is_decided
    return monitor.state is State.BROKEN or (began is State.PENDING and monitor.state is State.HOLDS)


def is_bounded(monitor: Monitor) -> TypeGuard[BoundedMonitor]:
    """Return True if the monitor has `needed_until`."""
    return hasattr(type(monitor), "needed_until")


def needed_until(*monitors: Monitor) -> float:
    """Return the latest sim time in s that one of the monitors needs; 0 if none needs any."""
    return max((monitor.needed_until for monitor in monitors if is_bounded(monitor)), default=0.0)


def unmet_premises(*monitors: Monitor) -> tuple[str, ...]:
    """Return the premises that never held in any of the monitors."""
    return tuple(premise for monitor in monitors if is_conditional(monitor) for premise in monitor.unmet_premises)


def is_conditional(monitor: Monitor) -> TypeGuard[ConditionalMonitor]:
    """Return True if the monitor has `unmet_premises`."""
    return hasattr(type(monitor), "unmet_premises")


def is_plottable(monitor: Monitor) -> TypeGuard[PlottableMonitor]:
    """Return True if the monitor has `signals`."""
    return hasattr(type(monitor), "signals")
