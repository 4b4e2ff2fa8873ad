"""The final outcomes of a call: those of scenarios that cannot run, and those of runs that have ended.

Most outcomes are final when their run has ended. With `--repeat` an outcome combines several runs. With several engines
the outcomes of one scenario are compared.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from collections.abc import Set as AbstractSet
from pathlib import Path

from sim_action.core.records import dataclass, replace
from sim_action.results.events import Event, Finished, Listener, RunEnded
from sim_action.results.journal_records import Planned, Record
from sim_action.results.outcome import Outcome
from sim_action.runner.child_outcome import unjudged
from sim_action.runner.run_plan import Plan
from sim_action.runner.runs import motion_file
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.sharing import share_parts
from sim_action.scenario.source import Refused


def planned_outcomes(plans: Sequence[Plan], of_patterns: Sequence[Outcome]) -> list[Planned]:
    """Return the outcomes that a call will have, in the order of its results.

    `of_patterns`: the outcomes of patterns that match no scenario; they come last.
    """
    outcomes = [Outcome.of_refused(plan) if isinstance(plan, Refused) else plan for plan in plans]
    every = (each for one in outcomes for each in ([one] if isinstance(one, Outcome) else map(unjudged, one)))
    planned: list[Planned] = []
    for outcome in (*every, *of_patterns):
        planned.append(share_parts(Planned.of(outcome), planned[-1] if planned else None))
    return planned


@dataclass(frozen=True, slots=True)
class _Scenario:
    """One scenario that runs.

    Attributes:
        runs: its runs, one for each engine.
        place: the index of its first outcome in the results.
        first: the index of its first run among all runs.
    """

    runs: tuple[LoadedScenario, ...]
    place: int
    first: int

    @property
    def places(self) -> range:
        """The places of its outcomes."""
        return range(self.place, self.place + len(self.runs))

    @property
    def is_compared(self) -> bool:
        """True if its runs on several engines are compared, or should be."""
        return len(self.runs) > 1 or self.runs[0].scenario.agreement is not None


class OutcomeAssembly:
    """A listener that passes events on, and adds `Finished` for each outcome that becomes final.

    Attributes:
        places: for each run, the index of its outcome in the results.
        repeat: the number of runs for each scenario and engine.
    """

    def __init__(self, plans: Sequence[Plan], repeat: int, folder: Path, motions: Path | None, emit: Listener) -> None:
        """Take the plan of a call.

        Args:
            plans: the scenarios, in the order of the results.
            repeat: the number of runs for each scenario and engine.
            folder: the output folder.
            motions: the folder for the motion of runs that are compared.
            emit: receives the events.
        """
        self.repeat, self._folder, self._motions, self._emit = repeat, folder, motions, emit
        self._scenarios: dict[int, _Scenario] = {}
        self._refused: dict[int, Refused] = {}
        self._ended: dict[int, dict[int, Outcome]] = {}
        self._keys: dict[int, set[str | None]] = {}
        # All runs of these places have ended, and their outcomes are final.
        self._final: set[int] = set()
        self.places: list[int] = []
        place = 0
        for plan in plans:
            if isinstance(plan, Refused):
                self._refused[place] = plan
                place += 1
                continue
            scenario = _Scenario(plan, place, len(self.places))
            self._scenarios |= dict.fromkeys(scenario.places, scenario)
            self.places += scenario.places
            place += len(plan)
        self._count = place

    def begin(self, of_patterns: Sequence[Outcome]) -> None:
        """Report the outcomes that need no run; `of_patterns`: those of patterns that match no scenario."""
        for place, refused in self._refused.items():
            self._emit(Finished(place, Outcome.of_refused(refused)))
        for place, outcome in enumerate(of_patterns, start=self._count):
            self._emit(Finished(place, outcome))

    def __call__(self, event: Event) -> None:
        """Pass an event on, and report the outcomes that become final by it."""
        if not isinstance(event, RunEnded):
            self._emit(event)
            return
        scenario = self._scenarios[event.place]
        if self.repeat > 1 or scenario.is_compared:
            self._emit(replace(event, is_one_of_several=True))
            self._take(event.place, event.turn, event.outcome, event.key)
        else:
            # A final outcome is in the journal before the terminal reports its run.
            self._take(event.place, event.turn, event.outcome, event.key)
            self._emit(event)

    @property
    def scenarios(self) -> Iterator[range]:
        """Yield the places of each scenario that runs, one for each engine."""
        return (scenario.places for place, scenario in self._scenarios.items() if place == scenario.place)

    def is_compared(self, place: int) -> bool:
        """Return True if the outcome at a place depends on runs at other places."""
        return self._scenarios[place].is_compared

    def take_over(self, records: Iterable[Record]) -> None:
        """Report outcomes of an earlier call: final ones, and those of single repetitions."""
        for record in records:
            assert record.place is not None
            assert record.outcome is not None
            if record.turn is None:
                self._final.add(record.place)
                self._emit(Finished(record.place, record.outcome, record.key, taken_over=True))
            else:
                self(RunEnded(record.place, record.turn, record.outcome, record.key, taken_over=True))

    @property
    def ended(self) -> AbstractSet[tuple[int, int]]:
        """The place and the turn of each run that needs no process any more."""
        final = {(place, turn) for place in self._final for turn in range(1, self.repeat + 1)}
        return final | {(place, turn) for place, turns in self._ended.items() for turn in turns}

    def end(self, outcomes: Sequence[Outcome]) -> None:
        """Report the outcomes of scenarios with runs that did not take place; `outcomes`: those of all runs."""
        for index, outcome in enumerate(outcomes):
            turn, run = divmod(index, len(self.places))
            place = self.places[run]
            if place not in self._final and turn + 1 not in self._ended.get(place, {}):
                self._take(place, turn + 1, outcome, None)

    def _take(self, place: int, turn: int, outcome: Outcome, key: str | None) -> None:
        self._ended.setdefault(place, {})[turn] = outcome
        self._keys.setdefault(place, set()).add(key)
        scenario = self._scenarios[place]
        if all(len(self._ended.get(each, {})) == self.repeat for each in scenario.places):
            for final, each in zip(scenario.places, self._outcomes(scenario), strict=True):
                self._emit(Finished(final, each, self._key(final)))
            for final in scenario.places:
                self._final.add(final)
                del self._ended[final], self._keys[final]

    def _key(self, place: int) -> str | None:
        first, *others = self._keys[place]
        return None if others else first

    def _outcomes(self, scenario: _Scenario) -> tuple[Outcome, ...]:
        """Return the final outcomes of a scenario, all of whose runs have ended."""
        merged = tuple(self._merged(run, place) for run, place in zip(scenario.runs, scenario.places, strict=True))
        if not scenario.is_compared:
            return merged
        from sim_action.runner.engine_agreement import with_agreement

        indices = range(scenario.first, scenario.first + len(scenario.runs))
        motions = [None if self._motions is None else motion_file(self._motions, index) for index in indices]
        return with_agreement(scenario.runs[0], merged, motions)

    def _merged(self, run: LoadedScenario, place: int) -> Outcome:
        """Return one outcome for all repetitions of a run."""
        turns = [self._ended[place][turn] for turn in range(1, self.repeat + 1)]
        if len(turns) == 1:
            return turns[0]
        from sim_action.runner.repeat import merge_repeats

        return merge_repeats(run, turns, self._folder)
