"""Signals that stay between two bounds each: invariants."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Self

from sim_action.assertions import State
from sim_action.assertions.fold import Invariant
from sim_action.core import units
from sim_action.state.verdict import Signal, Verdict

if TYPE_CHECKING:
    from sim_action.state.trace import FloatArray, Trace


@dataclass(frozen=True, slots=True)
class Interval:
    """What a signal, (T,) in `unit`, must stay between; the bounds belong to it."""

    name: str
    unit: str
    lower: float
    upper: float
    signal: Callable[[Trace], FloatArray]

    def sides(self, scale: float = 1.0) -> Iterator[Side]:
        """Both bounds; margins are compared with those of other signals as parts of `scale`."""
        yield Side(self, -1, self.lower, scale)
        yield Side(self, 1, self.upper, scale)


@dataclass(frozen=True, slots=True)
class Side:
    """One bound; `sign` is -1 for a lower and 1 for an upper one."""

    interval: Interval
    sign: int
    bound: float
    scale: float = 1.0
    fold: Invariant = Invariant()

    def margin(self) -> float:
        """As a part of the scale; infinite before the first moment."""
        return math.inf if self.fold.margin is None else self.fold.margin / self.scale

    def time(self) -> float:
        """Of the margin; infinite before the first moment."""
        return math.inf if self.fold.time is None else self.fold.time

    def observe(self, trace: Trace) -> Self:
        """The side after these moments."""
        signal = self.interval.signal(trace)
        return replace(self, fold=self.fold.observe(trace.time, self.sign * (self.bound - signal)))


@dataclass(frozen=True, slots=True)
class IntervalsMonitor:
    """All bounds; the first that was passed speaks, else the one that was nearest."""

    is_momentary: ClassVar[bool] = True

    sides: tuple[Side, ...]

    @property
    def state(self) -> State:
        """See Monitor.state."""
        broken = any(side.fold.state is State.BROKEN for side in self.sides)
        return State.BROKEN if broken else State.HOLDS

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        return replace(self, sides=tuple(side.observe(trace) for side in self.sides))

    def verdict(self) -> Verdict:
        """See Monitor.verdict."""
        passed = self.state is State.HOLDS
        broken = [side for side in self.sides if side.fold.state is State.BROKEN]
        side = min(broken, key=Side.time) if broken else min(self.sides, key=Side.margin)
        name, unit = side.interval.name, side.interval.unit
        margin, time = side.fold.margin, side.fold.time
        if margin is None or time is None:
            return Verdict(passed, None, None, None, unit, None, "no moment to measure")
        measured = side.bound - side.sign * margin
        where, limit = (f"{name} = {text}" for text in units.display_apart(measured, side.bound, unit))
        message = f"stayed within; nearest to {limit} with {where}" if passed else f"left past {limit}: {where}"
        return Verdict(passed, measured, side.bound, margin, unit, time, f"{message} at {time:.2f} s")

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Drawn.signals: one for each interval."""
        intervals = dict.fromkeys(side.interval for side in self.sides)
        return tuple(
            Signal(one.name, one.unit, trace.time, one.signal(trace), one.lower, one.upper) for one in intervals
        )
