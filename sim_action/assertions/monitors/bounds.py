"""Folds of a margin over time: goals and invariants; monitors that compare signals with bounds.

A margin is the distance of a signal to its limit. It is positive on the allowed side. `at_least` is a goal, `at_most`
and intervals are invariants.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from typing import ClassVar, Self

from typing_extensions import override

from sim_action.assertions.monitors import Monitor, State, Truth
from sim_action.core import units
from sim_action.core.lazy_numpy import FloatArray, np
from sim_action.core.records import dataclass, delegated, replace
from sim_action.state.trace import Trace
from sim_action.state.verdict import Signal, Verdict


@dataclass(frozen=True, slots=True)
class MarginFold:
    """The fold of a margin: it ends at the first step that decides. Until then it keeps the extreme step."""

    ends_as: ClassVar[State]

    # margin, time: of the step that decides, or of the extreme step; None before the first one. The time is in s.
    margin: float | None = None
    time: float | None = None
    state: State = State.PENDING

    def observe(self, time: FloatArray, margin: FloatArray) -> Self:
        """Return the fold after these steps; `time` in s and `margin`, each (T,)."""
        if self.state is self.ends_as or not len(time):
            return self
        is_goal = self.ends_as is State.HOLDS
        decides = margin >= 0 if is_goal else ~(margin >= 0)  # NaN breaks an invariant
        if decides.any():
            index = int(decides.argmax())
            return replace(self, margin=float(margin[index]), time=float(time[index]), state=self.ends_as)
        index = int(margin.argmax() if is_goal else margin.argmin())
        extreme = float(margin[index])
        if self.margin is None or (extreme > self.margin if is_goal else extreme < self.margin):
            return replace(self, margin=extreme, time=float(time[index]))
        return self


@dataclass(frozen=True, slots=True)
class Goal(MarginFold):
    """The fold of a goal: it comes true at the first margin >= 0. Until then it keeps the best step."""

    ends_as: ClassVar[State] = State.HOLDS


@dataclass(frozen=True, slots=True)
class Invariant(MarginFold):
    """The fold of an invariant: it breaks at the first margin < 0. Until then it keeps the worst step."""

    ends_as: ClassVar[State] = State.BROKEN

    state: State = State.HOLDS


def joined(*states: State) -> State:
    """Return the state of several monitors that must all hold."""
    for state in (State.BROKEN, State.PENDING):
        if state in states:
            return state
    return State.HOLDS


@dataclass(frozen=True, slots=True)
class ClosestApproach:
    """A goal: a distance, and optionally the error of an angle, come within their tolerances.

    The margin belongs to the quantity that is worse relative to its tolerance.
    """

    who: str  # the beginning of the message, such as "elbow came"
    place: str  # the target, for the message
    unit: str  # SI symbol of the distance
    tolerance: float
    angle_tolerance: float = math.inf  # tolerance of the angle in rad
    angle: str = "heading"  # the name of the angle, "heading" or "orientation"
    goal: Goal = Goal()
    distance: float = math.inf  # distance, angle_error: the values at the best step
    angle_error: float | None = None
    end: float = 0.0  # sim time of the last step, in s

    state: ClassVar[State] = delegated("goal.state")

    def observe(self, time: FloatArray, distance: FloatArray, angle_error: FloatArray | None = None) -> Self:
        """Return the fold after these steps; `distance` in `unit`, `angle_error` in rad, each (T,)."""
        if not len(time):
            return self
        margin = self.tolerance - distance
        if angle_error is not None:
            scale = self.tolerance / self.angle_tolerance
            margin = margin.clip(max=(self.angle_tolerance - angle_error) * scale)
        later = replace(self, goal=self.goal.observe(time, margin), end=float(time[-1]))
        if later.goal is self.goal:
            return later
        best = int((time == later.goal.time).argmax())
        error = None if angle_error is None else float(angle_error[best])
        return replace(later, distance=float(distance[best]), angle_error=error)

    def truth(self, time: FloatArray, distance: FloatArray, angle_error: FloatArray | None = None) -> Truth:
        """Return True where both errors are within their tolerances."""
        near = self.tolerance - distance >= 0
        return Truth(time, near if angle_error is None else near & (angle_error <= self.angle_tolerance))

    def drawn(
        self, name: str, time: FloatArray, distance: FloatArray, angle_error: FloatArray | None = None
    ) -> tuple[Signal, ...]:
        """Return the curves of the distance and the error of the angle, each with its tolerance."""
        curve = Signal(name, self.unit, time, distance, upper=self.tolerance)
        if angle_error is None:
            return (curve,)
        return (curve, Signal(f"{self.angle} error", "rad", time, angle_error, upper=self.angle_tolerance))

    def verdict(self) -> Verdict:
        """Return the verdict. `measured` and `limit` are distances; the margin includes the angle."""
        passed = self.state is State.HOLDS
        if self.goal.time is None:
            return Verdict(False, None, self.tolerance, None, self.unit, None, "no physics step to measure")
        # With enough digits to differ from the tolerance, which the title shows next to the message.
        near, _ = units.display_apart(self.distance, self.tolerance, self.unit)
        facing = self._facing()
        message = (
            f"{self.who} within {near} of {self.place}{facing} in {self.goal.time:.2f} s"
            if passed
            else f"{self.who} no closer than {near} to {self.place}{facing} in {self.end:.1f} s; closest at "
            f"{self.goal.time:.2f} s"
        )
        return Verdict(passed, self.distance, self.tolerance, self.goal.margin, self.unit, self.goal.time, message)

    def _facing(self) -> str:
        if self.angle_error is None:
            return ""
        off, _ = units.display_apart(self.angle_error, self.angle_tolerance, "rad")
        return f", {off} off its {self.angle},"


@dataclass(frozen=True, slots=True)
class Bounds:
    """The fold of one signal against a lower bound, an upper bound or both."""

    verb: str  # the verb of the message, such as "travelled"
    unit: str  # SI symbol of the signal
    at_least: float | None
    at_most: float | None
    goal: Goal = Goal()
    invariant: Invariant = Invariant()
    end: float = 0.0  # sim time of the last step, in s

    @property
    def state(self) -> State:
        """The state of both bounds together."""
        return joined(self.invariant.state, State.HOLDS if self.at_least is None else self.goal.state)

    @property
    def is_decided(self) -> bool:
        """See Monitor.is_decided. A lower bound that was reached decides, unless there is an upper bound."""
        return self.state is State.BROKEN or (self.at_most is None and self.state is State.HOLDS)

    @property
    def is_met(self) -> bool:
        """True if the signal has reached a lower bound, and there is no upper bound: the verdict is known."""
        return self.at_most is None and self.at_least is not None and self.goal.state is State.HOLDS

    def observe(self, time: FloatArray, signal: FloatArray) -> Self:
        """Return the fold after these steps; `time` in s and `signal` in `unit`, each (T,)."""
        if not len(time):
            return self
        goal = self.goal if self.at_least is None else self.goal.observe(time, signal - self.at_least)
        invariant = self.invariant if self.at_most is None else self.invariant.observe(time, self.at_most - signal)
        return replace(self, goal=goal, invariant=invariant, end=float(time[-1]))

    def truth(self, time: FloatArray, signal: FloatArray) -> Truth:
        """Return True where the signal, (T,) in `unit`, is within both bounds."""
        holds = np.isfinite(signal)
        if self.at_least is not None:
            holds &= signal - self.at_least >= 0
        if self.at_most is not None:
            holds &= self.at_most - signal >= 0
        return Truth(time, holds)

    def drawn(self, name: str, time: FloatArray, signal: FloatArray) -> Signal:
        """Return the curve of the signal with its bounds."""
        return Signal(name, self.unit, time, signal, self.at_least, self.at_most)

    def verdict(self) -> Verdict:
        """Return the verdict on a broken upper bound, else on the goal, else on the upper bound."""
        if self.at_least is None or self.invariant.state is State.BROKEN:
            return self._upper()
        return self._lower(self.at_least)

    def _lower(self, limit: float) -> Verdict:
        passed, margin = self.goal.state is State.HOLDS, self.goal.margin
        measured = None if margin is None else limit + margin
        if measured is None or self.goal.time is None:
            message = f"{self.verb} nothing: no physics step to measure"
        elif passed:
            message = f"{self.verb} {units.display(measured, self.unit)} in {self.goal.time:.2f} s"
        else:
            reached, required = units.display_apart(measured, limit, self.unit)
            message = f"{self.verb} {reached} of {required} in {self.end:.1f} s"
        return Verdict(passed, measured, limit, margin, self.unit, self.goal.time, message)

    def _upper(self) -> Verdict:
        limit, fold = self.at_most, self.invariant
        passed = fold.state is State.HOLDS
        if limit is None or fold.margin is None or fold.time is None:
            return Verdict(passed, None, limit, None, self.unit, None, "no physics step to measure")
        measured = limit - fold.margin
        worst, allowed = units.display_apart(measured, limit, self.unit)
        message = (
            f"{self.verb} at most {worst}, limit {allowed}"
            if passed
            else f"{self.verb} {worst} at {fold.time:.2f} s, more than {allowed}"
        )
        return Verdict(passed, measured, limit, fold.margin, self.unit, fold.time, message)


class BoundsMonitor(Monitor):
    """A monitor that compares one signal with bounds."""

    __slots__ = ()

    @property
    @abstractmethod
    def bounds(self) -> Bounds:
        """The fold of the signal."""

    @abstractmethod
    def values(self, trace: Trace) -> FloatArray:
        """Return (T,) the signal at the steps of `trace`, in the unit of the bounds."""

    state: ClassVar[State] = delegated("bounds.state")
    is_decided: ClassVar[bool] = delegated("bounds.is_decided")

    @override
    def verdict(self) -> Verdict:
        return self.bounds.verdict()

    @override
    def truth(self, trace: Trace) -> Truth:
        return self.bounds.truth(trace.time, self.values(trace))


@dataclass(frozen=True, slots=True)
class SignalMonitor(BoundsMonitor):
    """The monitor of a signal that is computed from each step alone."""

    is_momentary = True

    name: str  # the label of its curve
    signal: Callable[[Trace], FloatArray]
    bounds: Bounds
    joint: str = ""  # the joint that it is a reading of, if any

    @override
    def verdict(self) -> Verdict:
        return replace(self.bounds.verdict(), joint=self.joint)

    @override
    def values(self, trace: Trace) -> FloatArray:
        return self.signal(trace)

    @override
    def observe(self, trace: Trace) -> Self:
        # Nothing changes any more after a goal without an upper bound has come true.
        if self.bounds.is_met:
            return self
        return replace(self, bounds=self.bounds.observe(trace.time, self.signal(trace)))

    @override
    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        return (self.bounds.drawn(self.name, trace.time, self.signal(trace)),)


@dataclass(frozen=True, slots=True)
class AllLimits(Monitor):
    """A monitor that passes if all of its monitors pass."""

    monitors: tuple[Monitor, ...]

    @property
    @override
    def state(self) -> State:
        return joined(*(monitor.state for monitor in self.monitors))

    @property
    @override
    def is_momentary(self) -> bool:
        return all(monitor.is_momentary for monitor in self.monitors)

    @override
    def begin(self, trace: Trace) -> Self:
        return replace(self, monitors=tuple(monitor.begin(trace) for monitor in self.monitors))

    @override
    def observe(self, trace: Trace) -> Self:
        return replace(self, monitors=tuple(monitor.observe(trace) for monitor in self.monitors))

    @override
    def truth(self, trace: Trace) -> Truth:
        return all_true(trace, [monitor.truth(trace) for monitor in self.monitors])

    def verdict(self) -> Verdict:
        """Return the verdict of the limit that broke first, else of the limit with the smallest relative margin."""
        verdicts = [monitor.verdict() for monitor in self.monitors]
        nearest = min(verdicts, key=lambda v: (v.margin or 0.0) / (v.limit or 1.0))
        return min((v for v in verdicts if not v.passed), key=lambda v: v.time or 0.0, default=nearest)

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Monitor.signals. Returns the curves of all monitors."""
        return tuple(signal for monitor in self.monitors for signal in monitor.signals(trace))


@dataclass(frozen=True, slots=True)
class Interval:
    """A closed interval for a signal, which is (T,) in `unit`; `joint`: the joint that it is a reading of, if any."""

    name: str
    unit: str
    lower: float
    upper: float
    signal: Callable[[Trace], FloatArray]
    joint: str = ""

    def sides(self, scale: float = 1.0) -> Iterator[OneSidedBound]:
        """Yield both bounds. `scale` makes their margins comparable with the margins of other signals."""
        yield OneSidedBound(self, -1, self.lower, scale)
        yield OneSidedBound(self, 1, self.upper, scale)


@dataclass(frozen=True, slots=True)
class OneSidedBound:
    """One bound of an interval; `sign` is -1 for the lower bound and 1 for the upper bound."""

    interval: Interval
    sign: int
    bound: float
    scale: float = 1.0
    fold: Invariant = Invariant()

    def margin(self) -> float:
        """Return the margin divided by the scale; infinite before the first step."""
        return math.inf if self.fold.margin is None else self.fold.margin / self.scale

    def time(self) -> float:
        """Return the sim time of the margin in s; infinite before the first step."""
        return math.inf if self.fold.time is None else self.fold.time

    def observe(self, trace: Trace) -> Self:
        """Return the bound after the steps of `trace`."""
        signal = self.interval.signal(trace)
        return replace(self, fold=self.fold.observe(trace.time, self.sign * (self.bound - signal)))


@dataclass(frozen=True, slots=True)
class IntervalsMonitor(Monitor):
    """The monitor of several intervals. The verdict names the first broken bound, else the closest one."""

    is_momentary = True

    sides: tuple[OneSidedBound, ...]

    @property
    @override
    def state(self) -> State:
        broken = any(side.fold.state is State.BROKEN for side in self.sides)
        return State.BROKEN if broken else State.HOLDS

    @override
    def observe(self, trace: Trace) -> Self:
        return replace(self, sides=tuple(side.observe(trace) for side in self.sides))

    @override
    def truth(self, trace: Trace) -> Truth:
        margins = [side.sign * (side.bound - side.interval.signal(trace)) for side in self.sides]
        return Truth(trace.time, np.all([margin >= 0 for margin in margins], axis=0))

    @override
    def verdict(self) -> Verdict:
        passed = self.state is State.HOLDS
        broken = [side for side in self.sides if side.fold.state is State.BROKEN]
        side = min(broken, key=OneSidedBound.time) if broken else min(self.sides, key=OneSidedBound.margin)
        name, unit = side.interval.name, side.interval.unit
        margin, time = side.fold.margin, side.fold.time
        if margin is None or time is None:
            return Verdict(passed, None, None, None, unit, None, "no physics step to measure")
        measured = side.bound - side.sign * margin
        where, limit = (f"{name} = {text}" for text in units.display_apart(measured, side.bound, unit))
        message = (
            f"stayed within bounds; closest to {limit} with {where}"
            if passed
            else f"crossed the bound {limit}: {where}"
        )
        message = f"{message} at {time:.2f} s"
        return Verdict(passed, measured, side.bound, margin, unit, time, message, joint=side.interval.joint)

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Monitor.signals. Returns one curve for each interval."""
        intervals = dict.fromkeys(side.interval for side in self.sides)
        return tuple(
            Signal(one.name, one.unit, trace.time, one.signal(trace), one.lower, one.upper) for one in intervals
        )


def all_true(trace: Trace, truths: Sequence[Truth]) -> Truth:
    """Return True where all conditions are true; each has the steps of `trace`."""
    return Truth(trace.time, np.all([truth.holds for truth in truths], axis=0))


def check_bounds(
    at_least: float | None, at_most: float | None, unit: str, written: tuple[str, str] | None = None
) -> None:
    """Raise ValueError if both bounds are missing or if no value satisfies both."""
    if at_least is None and at_most is None:
        raise ValueError("give 'at_least', 'at_most' or both")
    check_order(at_least, at_most, unit, written)


def check_order(
    at_least: float | None, at_most: float | None, unit: str, written: tuple[str, str] | None = None
) -> None:
    """Raise ValueError if no value satisfies both bounds. `written` gives them as text if the unit is unknown."""
    if at_least is not None and at_most is not None and at_least > at_most:
        lower, upper = written or units.display_apart(at_least, at_most, unit)
        raise ValueError(f"nothing is at least {lower} and at most {upper}; swap the two?")


def check_interval(name: str, lower: float, upper: float, unit: str) -> None:
    """Raise ValueError if the lower bound of an interval is not less than the upper bound."""
    if lower >= upper:
        comparison = " is not less than ".join(units.display_apart(lower, upper, unit))
        raise ValueError(f"the bounds of '{name}' are swapped or equal: {comparison}")


def bounds_formula(quantity: str, at_least: float | None, at_most: float | None, *, goal: bool = True) -> str:
    """Return a formula for two bounds in SI units; `at_least` is a goal, or else also an invariant."""
    least = None if at_least is None else f"{'eventually' if goal else 'always'} ({quantity} >= {at_least!r})"
    most = None if at_most is None else f"always ({quantity} <= {at_most!r})"
    return " and ".join(part for part in (least, most) if part is not None)


def bounds_title(at_least: float | None, at_most: float | None, unit: str) -> str:
    """Return a text such as "at least 1.5 m, at most 2 m"."""
    named = (("at least", at_least), ("at most", at_most))
    return ", ".join(f"{name} {units.display(value, unit)}" for name, value in named if value is not None)
