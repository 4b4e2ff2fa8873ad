"""The panel of monitors of a run: it shows each step to the monitors of all expectations, and decides when it ends."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property
from typing import Final, Literal, Self

from sim_action.assertions.monitors import Monitor, State
from sim_action.assertions.monitors.windows import Window
from sim_action.core.errors import BadStart, FileProblem
from sim_action.core.records import dataclass, replace
from sim_action.core.units import TIME_EPSILON_S
from sim_action.scenario.model import Expectation, Scenario
from sim_action.state.observation import Observation
from sim_action.state.timeline import waits
from sim_action.state.trace import Trace
from sim_action.state.verdict import Verdict
from sim_action.world.scene import Scene

End = Literal["goals met", "expectation failed", "duration", "event", "time limit", "controllers finished"]
"""The reason for the end of a run; "controllers finished": every process that commands the robot has ended."""

# The monitors see all steps of a period at once, because each call costs time. Steps after the end of the run are
# discarded: a run with goals often ends early, a run without goals rarely does.
_PERIOD_S: Final = 0.5
_PERIOD_WITHOUT_GOALS_S: Final = 1.0
# Most goals come true when their pace said, or a little later. The last period has few steps after that.
_LEAST_PERIOD_S: Final = 0.05
_LATER: Final = 1.05


@dataclass(frozen=True)
class Panel:
    """The state of all monitors; each observation returns a new panel."""

    scenario: Scenario  # the scenario; its expectations have the same order as the monitors
    monitors: tuple[Window, ...]
    goals: tuple[bool, ...]  # True for each monitor that was pending at the start
    time: float = 0.0  # the sim time of the last moment seen, in s
    runs_on: bool = False  # True if the run goes on after an expectation has failed
    ends_at: float = math.inf  # the sim time in s at which an event ends the run; infinite without one

    @classmethod
    def open(cls, scenario: Scenario, scene: Scene, start: Observation, *, runs_on: bool = False) -> Self:
        """Return the panel before the first step. Raises BadStart."""
        monitors = tuple(_opened(index, expected, scene, start) for index, expected in enumerate(scenario.expect))
        goals = tuple(monitor.state is State.PENDING for monitor in monitors)
        return cls(scenario, monitors, goals, runs_on=runs_on)

    def following(self, scenario: Scenario, ends_at: float) -> Self:
        """Return the panel after events: a scenario with their times, and the time in s at which one ends the run."""
        pairs = zip(self.monitors, scenario.expect, strict=True)
        monitors = tuple(
            replace(monitor, after=expected.after) if expected.since else monitor for monitor, expected in pairs
        )
        return replace(self, scenario=scenario, monitors=monitors, ends_at=ends_at)

    @cached_property
    def has_goals(self) -> bool:
        """True if an expectation that can fail the run was pending at the start."""
        pairs = zip(self.goals, self.scenario.expect, strict=True)
        return any(goal and expected.severity == "error" for goal, expected in pairs)

    def observe(self, trace: Trace) -> Self:
        """Return the panel after the following moments."""
        monitors = tuple(monitor.observe(trace) for monitor in self.monitors)
        return replace(self, monitors=monitors, time=float(trace.time[-1]))

    @cached_property
    def end(self) -> End | None:
        """The reason why the run ends at the last moment seen; None if it goes on."""
        if not self.runs_on and any(m.state is State.BROKEN for m in self._decisive()):
            return "expectation failed"
        duration = self.scenario.duration
        if self.has_goals:
            is_over = self.time > 0 and not self.is_pending and self._reached(duration or 0.0)
            if is_over and self._all_closed():
                return "goals met"
        elif duration is not None and self._reached(duration) and self._all_closed():
            return "duration"
        if self.time >= self.ends_at - TIME_EPSILON_S:
            return "event"
        return "time limit" if self._reached(self.scenario.time_limit) else None

    def observe_until_end(self, trace: Trace) -> tuple[Self, Trace]:
        """Return the panel at the first moment that ends the run, or after all, with the moments seen."""
        later = self.observe(trace)
        if later.end is None:
            return later, trace
        if later.end != "expectation failed" and not self._is_over_before_last(trace):
            return later, trace
        # A run that has ended stays ended, so bisection finds the first such moment.
        before = 0
        ended = len(trace)
        while ended - before > 1:
            middle = (before + ended) // 2
            before, ended = (before, middle) if self.observe(trace.first(middle)).end else (middle, ended)
        seen = trace.first(ended)
        return (later, trace) if ended == len(trace) else (self.observe(seen), seen)

    def _is_over_before_last(self, trace: Trace) -> bool:
        least = min(self.scenario.duration or 0.0, self.scenario.time_limit)
        return len(trace) > 1 and self._is_reached(least, float(trace.time[-2]))

    def verdicts(self) -> tuple[Verdict, ...]:
        """Return one verdict for each expectation, as if the run ended now."""
        pairs = zip(self.monitors, self.goals, strict=True)
        judged = (replace(monitor.verdict(), goal=goal) for monitor, goal in pairs)
        verdicts = map(_unbegun, self.scenario.expect, judged)
        if self.end != "expectation failed":
            return tuple(verdicts)
        return tuple(map(_undecided, self.monitors, verdicts))

    def shortened(self) -> Iterator[tuple[str, float]]:
        """Yield the names of passed expectations that wait for no decision, with the planned end of each in s."""
        planned = self.scenario.duration if not (self.has_goals and self.is_pending) else None
        for monitor, expected, verdict in zip(self.monitors, self.scenario.expect, self.verdicts(), strict=True):
            until = min(expected.before, max(planned or self.scenario.time_limit, monitor.needed_until))
            is_open = verdict.status == "passed" and not (monitor.over or monitor.monitor.is_decided)
            if is_open and until > self.time + TIME_EPSILON_S:
                yield expected.name, until

    def _decisive(self) -> list[Monitor]:
        pairs = zip(self.monitors, self.scenario.expect, strict=True)
        return [monitor for monitor, expected in pairs if expected.severity == "error"]

    @property
    def is_pending(self) -> bool:
        """True if a goal has not come true yet."""
        return any(monitor.state is State.PENDING for monitor in self.monitors)

    @property
    def may_end_soon(self) -> bool:
        """True if goals that come true would end the run, and the last one has not yet; a duration comes first."""
        return self.is_pending and self._reached(self.scenario.duration or 0.0)

    def next_period(self, earlier: Self) -> float:
        """Return the time in s until the monitors see the next steps; `earlier`: the panel one period ago."""
        if not self.may_end_soon:
            return _PERIOD_WITHOUT_GOALS_S
        pairs, passed = zip(earlier.monitors, self.monitors, strict=True), self.time - earlier.time
        wait = max(_time_to_goal(was, now, passed) for was, now in pairs if now.state is State.PENDING)
        return min(_PERIOD_S, max(_LEAST_PERIOD_S, _LATER * wait))

    def _all_closed(self) -> bool:
        return self._reached(max((monitor.needed_until for monitor in self.monitors), default=0.0))

    def _reached(self, time: float) -> bool:
        return self._is_reached(time, self.time)

    def _is_reached(self, time: float, seen: float) -> bool:
        return seen >= self.scenario.steps(time) / self.scenario.physics.rate - TIME_EPSILON_S


def _opened(index: int, expected: Expectation, scene: Scene, start: Observation) -> Window:
    try:
        monitor = expected.assertion.opened(scene, start, expected.span)
    except FileProblem as error:
        raise BadStart([(("expect", index), str(error))]) from None
    return Window(monitor, expected.after, expected.before)


def _time_to_goal(earlier: Monitor, now: Monitor, passed: float) -> float:
    """Return the time in s until a goal comes true at the pace of the last `passed` s; infinite if none is known."""
    was, left = earlier.verdict().margin, now.verdict().margin
    if was is None or left is None or not was < left < 0:
        return math.inf
    return -left / (left - was) * passed


def _unbegun(expected: Expectation, verdict: Verdict) -> Verdict:
    """Return the verdict on an expectation; it names the event that it still waits for."""
    if not waits(expected.after):
        return verdict
    return replace(verdict, message=f"never checked: event '{expected.since}' never happened")


def _undecided(monitor: Window, verdict: Verdict) -> Verdict:
    """Return the verdict after another expectation ended the run; it is marked if it was still undecided."""
    if verdict.passed or monitor.over or monitor.state is State.BROKEN:
        return verdict
    is_cut_short = monitor.state is State.PENDING and verdict.status == "failed"
    remark = ", when the run ended" if is_cut_short else ""
    return replace(verdict, message=f"{verdict.message}{remark}", cut_off=True)
