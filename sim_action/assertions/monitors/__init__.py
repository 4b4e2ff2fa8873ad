"""Monitors: the part of an assertion that watches a run.

A monitor is a frozen value: `observe` returns the monitor after more physics steps. The simulation loop feeds it block
by block; a stored trace is fed in one piece. The verdict is the same.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from enum import Enum
from typing import Any, Final, NamedTuple, Self

from typing_extensions import override

from sim_action.core.lazy_numpy import FloatArray, NDArray, np
from sim_action.core.records import dataclass, replace
from sim_action.state.trace import Trace
from sim_action.state.verdict import Signal, Verdict

FORCE_WINDOW_S: Final = 0.05
"""The time over which reports average contact forces, and assertions, too, if a scenario states no other."""


class State(Enum):
    """The result of a monitor so far."""

    PENDING = "a goal that has not come true yet"
    HOLDS = "a goal that came true, or an invariant that is not broken so far"
    BROKEN = "it failed, and no later step can change that"


class Truth(NamedTuple):
    """The truth of a condition: at each of (N,) s of sim time, rising, (N,) True or False."""

    time: FloatArray
    holds: NDArray[np.bool_]


class Fold(ABC):
    """A condition, as far as it is known after the steps so far."""

    __slots__ = ()

    @property
    @abstractmethod
    def state(self) -> State:
        """The result so far."""

    @property
    def is_goal(self) -> bool:
        """True if it is decided as soon as it holds. An invariant holds from the beginning."""
        return False

    @property
    def is_decided(self) -> bool:
        """True if no later step can change the result: a goal came true, or anything is broken."""
        return self.state is State.BROKEN or (self.is_goal and self.state is State.HOLDS)

    @property
    def needed_until(self) -> float:
        """The sim time in s up to which the run must go on; 0 before the first step, and when it is decided.

        A monitor with a quantity over a finite time must see all of that time before a passing verdict is final. After
        the first step it never grows, so a run that may end stays one that may end.
        """
        return 0.0


class Monitor(Fold):
    """A fold over the physics steps of a run. It is frozen; `observe` returns its successor."""

    __slots__ = ()

    @property
    def leaves(self) -> tuple[Monitor, ...]:
        """The monitors of the parts of a combined assertion, in order, or the monitor itself."""
        return (self,)

    @property
    def unmet_premises(self) -> tuple[str, ...]:
        """The premises that never held, as text. The monitor may hold only for that reason."""
        return ()

    @property
    def is_sampled(self) -> bool:
        """True if its truth has moments between the steps, from a sensor. The last one counts until the next."""
        return False

    @property
    def is_momentary(self) -> bool:
        """True if each point of its signals depends on one step only. Such curves are valid outside the window."""
        return False

    def begin(self, trace: Trace) -> Self:
        """Return the monitor after the steps up to the one that opens its window, if it accumulates."""
        return self

    @abstractmethod
    def observe(self, trace: Trace) -> Self:
        """Return the monitor after the steps of `trace`, which has every physics step."""

    @abstractmethod
    def verdict(self) -> Verdict:
        """Return the verdict as if the run ended now."""

    def truth(self, trace: Trace) -> Truth:
        """Return the truth at the moments of `trace`, which follows the steps observed so far.

        The moments are the steps, or the readings of a sensor. Limits that must hold throughout count at each moment.
        Raises NotImplementedError if the assertion is not true or false at a moment, see `Assertion.has_truth`.
        """
        raise NotImplementedError(type(self).__name__)

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """Return the curves that `observe(trace)` would judge. `trace` is not empty and may be decimated."""
        return ()


def _states(monitor: Any, name: str) -> bool:
    if not isinstance(monitor, Monitor):
        return hasattr(monitor, name)
    default = getattr(Monitor, name)
    return getattr(type(monitor), name, default) is not default


def _own(name: str) -> Any:
    """Return a property of an adapted monitor, read from its `monitor`, or else the default of Monitor."""

    def read(adapted: AdaptedMonitor) -> Any:
        return getattr(adapted.monitor if _states(adapted.monitor, name) else super(AdaptedMonitor, adapted), name)

    return property(read)


@dataclass(frozen=True)
class AdaptedMonitor(Monitor):
    """A monitor of an installed package that does not derive from Monitor: what it lacks is as in Monitor."""

    monitor: Any
    began: State  # its state before the first step

    @classmethod
    def of(cls, monitor: Any) -> Monitor:
        """Return the monitor, which has seen no step, with all that a Monitor has."""
        if isinstance(monitor, Monitor) and (monitor.is_goal or _states(monitor, "is_decided")):
            return monitor
        began = monitor.state
        return monitor if isinstance(monitor, Monitor) and began is State.HOLDS else cls(monitor, began)

    @property
    @override
    def state(self) -> State:
        state: State = self.monitor.state
        return state

    @property
    @override
    def is_goal(self) -> bool:
        return self.began is State.PENDING

    is_decided = _own("is_decided")
    needed_until = _own("needed_until")
    unmet_premises = _own("unmet_premises")
    is_sampled = _own("is_sampled")
    is_momentary = _own("is_momentary")
    truth = _own("truth")
    signals = _own("signals")

    @override
    def begin(self, trace: Trace) -> Self:
        return replace(self, monitor=self.monitor.begin(trace)) if _states(self.monitor, "begin") else self

    @override
    def observe(self, trace: Trace) -> Self:
        return replace(self, monitor=self.monitor.observe(trace))

    @override
    def verdict(self) -> Verdict:
        verdict: Verdict = self.monitor.verdict()
        return verdict
