"""Distances folded against bounds: what the monitor of `clearance` does."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Final, Self

from sim_action.assertions import State
from sim_action.assertions.fold import Goal, Invariant, joined
from sim_action.assertions.least_distance import least_so_far
from sim_action.core import units
from sim_action.state.trace_records import ClearanceRecord, Nearness
from sim_action.state.verdict import Signal, Verdict

if TYPE_CHECKING:
    from sim_action.assertions.clearance import Clearance
    from sim_action.state.trace import Trace

_NOTHING: Final = ClearanceRecord.of([])


@dataclass(frozen=True, slots=True)
class ClearanceMonitor:
    """Folds distances against both bounds; keeps what was nearest to what when it decided.

    Attributes:
        at_goal, at_worst: the moments that the two folds are about.
        end: sim time in s of the last moment seen.
    """

    is_momentary: ClassVar[bool] = False

    spec: Clearance
    goal: Goal = Goal()
    invariant: Invariant = Invariant()
    at_goal: Nearness | None = None
    at_worst: Nearness | None = None
    end: float = 0.0

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return joined(self.invariant.state, State.HOLDS if self.spec.at_most is None else self.goal.state)

    @property
    def is_decided(self) -> bool:
        """See Decisive.is_decided: what was near enough is, unless it may come too near."""
        return self.state is State.BROKEN or (self.spec.at_least is None and self.state is State.HOLDS)

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        record = trace.clearances.get(self.spec.watch, _NOTHING)
        spec, goal, invariant = self.spec, self.goal, self.invariant
        if spec.at_most is not None:
            goal = goal.observe(record.time, spec.at_most - record.distance)
        if spec.at_least is not None:
            invariant = invariant.observe(record.time, record.distance - spec.at_least)
        return replace(
            self,
            goal=goal,
            invariant=invariant,
            at_goal=self.at_goal if goal is self.goal else _moment(record, goal.time),
            at_worst=self.at_worst if invariant is self.invariant else _moment(record, invariant.time),
            end=float(trace.time[-1]) if len(trace) else self.end,
        )

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Drawn.signals: distances are told only where they are less than any before."""
        name = "least distance" + (f" to {', '.join(self.spec.to)}" if self.spec.to else "")
        time, distance = least_so_far(trace, self.spec.watch)
        return (Signal(name, "m", time, distance, self.spec.at_least, self.spec.at_most),) if len(time) else ()

    def verdict(self) -> Verdict:
        """The bound that decides: a broken one, else the goal, else the one that held."""
        if self.spec.at_most is None or self.invariant.state is State.BROKEN:
            return self._kept_clear()
        return self._came_near(self.spec.at_most)

    def _kept_clear(self) -> Verdict:
        limit, near, passed = self.spec.at_least, self.at_worst, self.invariant.state is State.HOLDS
        if limit is None or near is None:
            return Verdict(passed, None, limit, None, "m", None, "no moment to measure")
        distance, least = units.display_apart(near.distance, limit, "m")
        message = f"{_told(near, distance)} at {near.time:.2f} s, " + (
            "at the nearest" if passed else f"less than {least}"
        )
        return Verdict(passed, near.distance, limit, self.invariant.margin, "m", near.time, message)

    def _came_near(self, limit: float) -> Verdict:
        near, passed = self.at_goal, self.goal.state is State.HOLDS
        if near is None:
            return Verdict(False, None, limit, None, "m", None, "no moment to measure")
        distance, _ = units.display_apart(near.distance, limit, "m")
        message = (
            f"{_told(near, distance)} at {near.time:.2f} s"
            if passed
            else f"{_told(near, distance)} at the nearest, at {near.time:.2f} s, in {self.end:.1f} s"
        )
        return Verdict(passed, near.distance, limit, self.goal.margin, "m", near.time, message)


def _told(near: Nearness, distance: str) -> str:
    if near.distance < 0:
        return f"{near.link} was inside {near.body} by {distance.removeprefix('-')}"
    return f"{near.link} was {distance} from {near.body}"


def _moment(record: ClearanceRecord, time: float | None) -> Nearness:
    return record.at(int((record.time == time).argmax()))
