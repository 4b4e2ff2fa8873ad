"""The gates that stop early, and the runs that they no longer need.

The first runs in their order decide a gate. So the verdict is the same with any number of jobs. Runs beyond the
decision that have ended keep their outcomes.
"""

from __future__ import annotations

from collections.abc import Sequence

from sim_action.core.statistics.sequential import SeenResults, SequentialTest
from sim_action.results.events import Event, Finished
from sim_action.results.gates import result_of, sequential_test
from sim_action.results.outcome import Outcome
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.variations.gate import PlannedGate


class _Followed:
    """A gate, and what its test has seen of its runs, in their order."""

    def __init__(self, planned: PlannedGate, test: SequentialTest) -> None:
        self.planned = planned
        self.places: list[int] = []
        self._seen = SeenResults(test)
        # Runs that have ended before an earlier one.
        self._waiting: dict[int, Outcome] = {}

    @property
    def is_decided(self) -> bool:
        return self._seen.verdict is not None

    def take(self, place: int, outcome: Outcome) -> None:
        self._waiting[place] = outcome
        while not self.is_decided and self._seen.runs < len(self.places):
            run = self._waiting.pop(self.places[self._seen.runs], None)
            if run is None or run.status == "skipped":
                break
            self._seen.add(result_of(run))


class EarlyStop:
    """A listener that follows all gates which stop early."""

    def __init__(self, runs: Sequence[LoadedScenario], places: Sequence[int]) -> None:
        """Take the runs of a call, and the place of each in the results.

        A gate of which another call has runs is not followed: this call does not see them.
        """
        gates: dict[tuple[str, str], _Followed] = {}
        for run, place in zip(runs, places, strict=True):
            gate = run.source.gate
            if gate is not None and (test := sequential_test(gate)) is not None:
                gates.setdefault((gate.file, gate.name), _Followed(gate, test)).places.append(place)
        whole = [gate for gate in gates.values() if len(gate.places) == gate.planned.runs]
        self._by_place = {place: gate for gate in whole for place in gate.places}

    def __call__(self, event: Event) -> None:
        """Take the outcome of a run."""
        if isinstance(event, Finished) and (gate := self._by_place.get(event.place)) is not None:
            gate.take(event.place, event.outcome)

    def is_needless(self, place: int) -> bool:
        """Return True if the gate of a run is decided without it."""
        gate = self._by_place.get(place)
        return gate is not None and gate.is_decided
