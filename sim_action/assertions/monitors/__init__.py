"""Monitors: the part of an assertion that watches a run.

A monitor is a frozen value: `observe` returns the monitor after more physics steps. The simulation loop feeds it block
by block; a stored trace is fed in one piece. The verdict is the same.
"""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING, Protocol, Self, TypeGuard

if TYPE_CHECKING:
    from sim_action.state.trace import Trace
    from sim_action.state.verdict import Signal, Verdict


class State(Enum):
    """What a monitor can say before the run is over."""

    PENDING = "a goal that has not come true yet"
    HOLDS = "a goal that came true, or an invariant that was not broken so far"
    BROKEN = "no later moment can mend it"


class Monitor(Protocol):
    """The fold: frozen, and replaced by `observe`."""

    @property
    def state(self) -> State:
        """What is known so far."""

    def observe(self, trace: Trace) -> Self:
        """The monitor after the moments that follow; `trace` has every physics step."""

    def verdict(self) -> Verdict:
        """The judgement, if nothing more came."""


class CumulativeMonitor(Monitor, Protocol):
    """A monitor that goes on from the moment before: it has to know where its time window begins."""

    def begin(self, trace: Trace) -> Self:
        """The monitor after moments up to the one that its window opens at; that one is observed too."""


class DecidingMonitor(Monitor, Protocol):
    """A monitor that says itself when it is decided.

    Of others, a goal is decided when it comes true, and an invariant when it breaks.
    """

    @property
    def is_decided(self) -> bool:
        """Whether no later moment can change what it says."""


class PlottableMonitor(Monitor, Protocol):
    """A monitor that can show what it looks at."""

    @property
    def is_momentary(self) -> bool:
        """Whether its curves depend on nothing that was before: they are of use beyond its time window, too."""

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """What it would fold, were it to observe `trace`, which is not empty, and may be decimated."""


def is_cumulative(monitor: Monitor) -> TypeGuard[CumulativeMonitor]:
    """Whether its class says so; to compare it with the protocol takes as long as to observe a block of moments."""
    return hasattr(type(monitor), "begin")


def is_deciding(monitor: Monitor) -> TypeGuard[DecidingMonitor]:
    """Whether its class says so."""
    return hasattr(type(monitor), "is_decided")


def is_plottable(monitor: Monitor) -> TypeGuard[PlottableMonitor]:
    """Whether its class says so."""
    return hasattr(type(monitor), "signals")
