"""The events of a run: their conditions are judged after every step, and their actions act from the next step on."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from sim_action.assertions.monitors import Monitor, State
from sim_action.assertions.monitors.windows import HoldTime
from sim_action.core.errors import RunError
from sim_action.core.units import STEP_EPSILON, TIME_EPSILON_S, display, first_step
from sim_action.core.wording import quoted
from sim_action.scenario.events import Condition, Happening, after, time_marks
from sim_action.scenario.model import Scenario
from sim_action.simulation.panel import Panel
from sim_action.state.observation import Observation
from sim_action.state.timeline import NOT_YET, TimeMark
from sim_action.state.trace import Trace
from sim_action.state.trace_records import ALWAYS
from sim_action.world.claims import ClaimFinding
from sim_action.world.scene import Scene

EVENT_NEVER_BEGAN: Final = "event-never-began"
MAX_TIMES: Final = 200  # the number of times that the results of a run keep of one event, the first ones


class _Watch:
    """The condition of one event, judged from a step on; `holds`: it was true at the last moments."""

    def __init__(self, condition: Condition, scene: Scene, start: Observation) -> None:
        assert condition.assertion is not None
        self._assertion, self._span, self._scene, self._start = condition.assertion, condition.span, scene, start
        self._awaited = condition.assertion.awaited
        self._was_true = False
        self._monitor = self._opened()
        self._hold = HoldTime(condition.span) if condition.span else None

    def _opened(self, *, negated: bool = False) -> Monitor:
        """Return the monitor of the assertion; a formula's monitor waits until it is true, or false if `negated`."""
        return self._assertion.waiting(self._span, negated=negated).started(self._scene, self._start)

    @property
    def nearest(self) -> str:
        """The nearest that the condition came to being true, in words."""
        verdict = self._monitor.verdict()
        if not self._awaited or verdict.margin is None or verdict.time is None or verdict.margin >= 0:
            return verdict.message
        missing = display(-verdict.margin, verdict.unit)
        return f"it waits for {self._awaited}, which was nearest at {verdict.time:.2f} s and missed by {missing}"

    def becomes_true(self, trace: Trace) -> bool:
        """Take the next moments; return True if the condition became true at one of them."""
        if self._awaited:
            self._monitor = self._monitor.observe(trace)
            if self._monitor.state is not State.HOLDS:
                return False
            # It can become true again after it was false.
            self._was_true = not self._was_true
            self._monitor = self._opened(negated=self._was_true)
            return self._was_true
        time, holds = self._monitor.truth(trace)
        self._monitor = self._monitor.observe(trace)
        if self._hold is not None and len(time):
            lasting = self._hold.lasting(time, holds)
            self._hold = self._hold.observe(time, holds)
            holds = lasting >= self._span - TIME_EPSILON_S
        before, self._was_true = self._was_true, bool(holds[-1]) if len(holds) else self._was_true
        return bool(np.any(holds & ~np.concatenate(([before], holds[:-1])))) if len(holds) else False


def _refuse_absent(scenario: Scenario, happening: Happening) -> None:
    """Raise RunError if an event pushes a body that is not there."""
    event, time = scenario.events[happening.event], happening.time
    bodies = {body.name: body.presence(scenario.physics.rate) for body in scenario.world.objects}
    for number, action in enumerate(event.actions):
        name = action.disturb.body if action.disturb is not None else None
        first, gone = bodies.get(name or "", ALWAYS)
        if name and not first <= time * scenario.physics.rate + STEP_EPSILON < gone:
            why = "was removed before" if first <= time * scenario.physics.rate else "has not appeared yet"
            raise RunError(
                f"event '{event.name}' disturbs body '{name}' at {time:.4g} s, but it {why}; let the event begin only "
                "while it is there, for example with 'since'",
                keys=("events", happening.event, "do", number, "disturb", "body"),
            )


class RunEvents:
    """The events of one run.

    Attributes:
        happenings: the happenings so far, in the order of time and then of the file.
        scenario: the scenario with the times of these happenings.
        end: the sim time in s at which an event ends the run; infinite without one.
    """

    def __init__(self, scenario: Scenario, scene: Scene, start: Observation, opening: Trace) -> None:
        """Open the conditions at t = 0; `opening`: the moment at t = 0."""
        self._scenario, self.scenario, self._scene, self._start = scenario, scenario, scene, start
        self._rate = scenario.physics.rate
        self.happenings: list[Happening] = []
        self.end = NOT_YET
        # Index of an event -> the step at which it happens.
        self._due: dict[int, int] = {}
        self._watches: dict[int, _Watch] = {}
        self._waiting: set[int] = set()
        self._over: set[int] = set()
        for index, event in enumerate(scenario.events):
            if event.when.at:
                self._due[index] = max(1, first_step(event.when.at + event.when.span, self._rate))
            elif event.when.assertion is not None and not event.when.since:
                self._watches[index] = _Watch(event.when, scene, start)
            elif event.when.assertion is not None:
                self._waiting.add(index)
        self._true = self._judged(opening)

    @property
    def watches(self) -> bool:
        """True if a condition has to be judged at each step."""
        return bool(self._watches)

    def judge(self, trace: Trace) -> None:
        """Judge the moments since the last call, the last of which is the present."""
        self._true |= self._judged(trace)

    def _judged(self, trace: Trace) -> set[int]:
        # The watchdog reports a state that is not a number.
        if not len(trace) or not np.isfinite(trace.state).all():
            return set()
        return {index for index, watch in self._watches.items() if watch.becomes_true(trace)}

    def next_due(self, step: int, until: int) -> int:
        """Return the step up to which the run may go on before events are asked for again."""
        if self._watches:
            return step + 1
        return min([until, *(max(step + 1, due - 1) for due in self._due.values())])

    def happening(self, step: int) -> list[int]:
        """Return the indices of the events that happen at the step after a step, in the order of the file."""
        happening = step + 1
        begins = self._true | {index for index, due in self._due.items() if due <= happening}
        self._true = set()
        waiting = [*begins]
        while waiting:
            # Events that wait for one of these happen at the same step, or later.
            name = self._scenario.events[waiting.pop()].name
            for index, event in enumerate(self._scenario.events):
                if event.when.event != name or index in begins | self._over:
                    continue
                if event.when.span:
                    self._due[index] = happening + max(1, first_step(event.when.span, self._rate))
                else:
                    begins.add(index)
                    waiting.append(index)
        for index in sorted(begins):
            self._happen(index, happening)
        return sorted(begins)

    def _happen(self, index: int, step: int) -> None:
        event = self._scenario.events[index]
        self.happenings.append(Happening(index, step / self._rate))
        self.scenario = after(self.scenario, self.happenings[-1:])
        _refuse_absent(self.scenario, self.happenings[-1])
        self._due.pop(index, None)
        if not event.every:
            self._over.add(index)
            self._watches.pop(index, None)
        if self._ends(index):
            self.end = min(self.end, step / self._rate)
        for later in [later for later in self._waiting if self._scenario.events[later].when.since == event.name]:
            self._waiting.remove(later)
            self._watches[later] = _Watch(self._scenario.events[later].when, self._scene, self._start)

    def _ends(self, index: int) -> bool:
        return any(action.end for action in self._scenario.events[index].actions)

    def scenario_until(self, end: float) -> Scenario:
        """Return the scenario with the times of the happenings until a sim time in s."""
        happened = self.until(end)
        return self.scenario if len(happened) == len(self.happenings) else after(self._scenario, happened)

    def until(self, end: float) -> list[Happening]:
        """Return the happenings until a sim time in s."""
        return [happening for happening in self.happenings if happening.time <= end + 0.5 / self._rate]

    def times(self, end: float) -> dict[str, tuple[float, ...]]:
        """Return the name of each event -> the sim times in s at which it happened, until a sim time in s."""
        happened = self.until(end)
        return {
            event.name: tuple(happening.time for happening in happened if happening.event == index)[:MAX_TIMES]
            for index, event in enumerate(self._scenario.events)
        }

    def time_marks(self, end: float) -> Iterator[TimeMark]:
        """Yield the marks of the happenings until a sim time in s."""
        return time_marks(self._scenario, self.until(end))

    def findings(self, end: float) -> Iterator[ClaimFinding]:
        """Yield a finding on each event that did not happen until a sim time in s."""
        happened = {happening.event for happening in self.until(end)}
        for index, event in enumerate(self._scenario.events):
            if index not in happened:
                why = self._why_not(index, end)
                words = "; ".join(action.words for action in event.actions)
                message = f"event '{event.name}' never happened: {why} (so not: {words})"
                yield ClaimFinding(EVENT_NEVER_BEGAN, ("events", index, "when"), message)

    def note_of_end(self, panel: Panel) -> Iterator[str]:
        """Yield a note if one of them ended the run before expectations were watched for their time."""
        if panel.end != "event":
            return
        shortened: dict[float, list[str]] = {}
        for name, until in panel.shortened():
            shortened.setdefault(until, []).append(name)
        (ended, *_) = (happening.event for happening in self.happenings if self._ends(happening.event))
        for until, names in sorted(shortened.items()):
            end = f"event '{self._scenario.events[ended].name}' ended the run at {display(self.end, 's')}"
            yield f"{end}, so these were judged until then and not until {display(until, 's')}: {quoted(names)}"

    def _why_not(self, index: int, end: float) -> str:
        when = self._scenario.events[index].when
        name = when.event or (when.since if index in self._waiting else "")
        if index in self._due:
            due = self._due[index] / self._rate
            return f"it is due at {display(due, 's')}, but the run ended at {display(end, 's')}"
        if name:
            return f"it waits for event '{name}', and the run ended at {end:.4g} s"
        return self._watches[index].nearest if index in self._watches else f"the run ended at {end:.4g} s"
