"""The gates that stop early: they tell which runs are not needed any more.

A gate is decided by its first runs in their order, however many run at the same time. So the verdict is the same with
any number of jobs; runs beyond the decision that have ended keep their outcomes.
"""

from __future__ import annotations

from collections.abc import Sequence

from sim_action.core.records import dataclass, field
from sim_action.results.events import Event, Finished
from sim_action.results.gates import decided_after
from sim_action.results.outcome import Outcome
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.variations.gate import PlannedGate


@dataclass(slots=True)
class _Followed:
    """A gate, and the final outcomes of its runs by their places."""

    planned: PlannedGate
    places: list[int] = field(default_factory=list)
    outcomes: dict[int, Outcome] = field(default_factory=dict)
    is_decided: bool = False

    def take(self, place: int, outcome: Outcome) -> None:
        self.outcomes[place] = outcome
        known = [self.outcomes.get(each) for each in self.places]
        self.is_decided = self.is_decided or decided_after(self.planned, known) is not None


class EarlyStop:
    """A listener that follows all gates which stop early."""

    def __init__(self, runs: Sequence[LoadedScenario], places: Sequence[int]) -> None:
        """Take the runs of a call, and the place of each in the results.

        A gate of which another call has runs is not followed: this call does not see them.
        """
        gates: dict[tuple[str, str], _Followed] = {}
        for run, place in zip(runs, places, strict=True):
            gate = run.source.gate
            if gate is not None and gate.gate.stop_early is not None:
                gates.setdefault((gate.file, gate.name), _Followed(gate)).places.append(place)
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
