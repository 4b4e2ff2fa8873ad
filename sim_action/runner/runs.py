"""The runs of a call, what schedules them, and the gates that stop early and need only some of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from collections.abc import Set as AbstractSet
from functools import cached_property
from pathlib import Path

from sim_action.core.errors import ExitCode
from sim_action.core.process import Interruption
from sim_action.core.records import dataclass, field
from sim_action.core.statistics import SeenResults, SequentialTest
from sim_action.results.artifacts import RunFiles, file_stems
from sim_action.results.events import Event, Finished, Listener, RunEnded, Started
from sim_action.results.gates import result_of, sequential_test
from sim_action.results.outcome import Outcome
from sim_action.runner.child_outcome import without_run
from sim_action.runner.job import Job
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.variations.gate import PlannedGate


def motion_file(folder: Path, index: int) -> Path:
    """Return the file for the motion of the run with this index in the list of scenarios."""
    return folder / f"{index}.npz"


@dataclass(frozen=True)
class Runs:
    """The runs of a call. Each has an index: the whole list of scenarios runs once in each repetition, in order."""

    scenarios: Sequence[LoadedScenario]  # the scenarios to run
    folder: Path  # the folder of the results; traces are written below it
    # the number of repetitions; if there are several, each run has its own interpreter and seed of hashes
    repeat: int = 1
    places: Sequence[int] = ()  # the index in the results for each scenario; empty: that in `scenarios`
    turns: Sequence[int] = ()  # the number of runs with the same place before each scenario; empty: 0
    replays: bool = False  # write replays, too
    formats: Sequence[str] = ()  # the formats of recordings to write
    motions: Path | None = None  # the folder for the motion of runs that are compared, see `motion_file`
    # the place and the turn of each run that an earlier call has ended; they do not start
    ended: AbstractSet[tuple[int, int]] = frozenset()
    fail_fast: bool = False  # start no run after the first one that has not passed
    # returns True for a place in the results if its run need not start any more
    is_needless: Callable[[int], bool] = lambda _: False
    here: Path = field(default_factory=Path.cwd)  # the folder that reports name files from

    def __len__(self) -> int:
        return len(self.scenarios) * self.repeat

    @cached_property
    def _stems(self) -> Sequence[str]:
        """The name without an ending for the files of each run."""
        return list(file_stems(loaded.scenario.name for _ in range(self.repeat) for loaded in self.scenarios))

    def loaded(self, index: int) -> LoadedScenario:
        """Return the scenario of a run."""
        return self.scenarios[index % len(self.scenarios)]

    def name(self, index: int) -> str:
        """Return the name of the scenario of a run."""
        return self.loaded(index).scenario.name

    def place_and_turn(self, index: int) -> tuple[int, int]:
        """Return the index of a run in the results, and the number of its repetition, counted from 1."""
        turn, number = divmod(index, len(self.scenarios))
        first = self.turns[number] if self.turns else 0
        return (self.places[number] if self.places else number), first + turn + 1

    @property
    def waiting(self) -> list[int]:
        """The runs that must start."""
        return [index for index in range(len(self)) if self.place_and_turn(index) not in self.ended]

    def job(self, index: int, *, memory_is_limited: bool = True, is_fresh: bool = False) -> Job:
        """Return the job of a run, made late: 10,000 take 20 MB; `is_fresh`: each run has its own interpreter."""
        turn, number = divmod(index, len(self.scenarios))
        loaded, results = self.scenarios[number], self.folder.absolute()
        files = RunFiles.of(self._stems[index], results, replays=self.replays, formats=self.formats)
        # Repeated runs are equal, or have no verdict: the motion of the first one is enough.
        motion = motion_file(self.motions, number) if self.motions and loaded.compared and turn == 0 else None
        return Job(
            loaded,
            files.trace,
            results,
            memory_is_limited,
            files.replay,
            files.recordings,
            hash_seed=turn if is_fresh else None,
            motion=motion,
            here=self.here,
        )


class Scheduler(ABC):
    """Runs all runs of a call and reports their events; a subclass says where they run."""

    def __init__(self, runs: Runs, emit: Listener, interruption: Interruption) -> None:
        """Take the runs; `emit` receives their events, from `Started` to `RunEnded`; `interruption` ends the call."""
        self._runs, self._emit, self._interruption = runs, emit, interruption
        self._outcomes: dict[int, Outcome] = {}
        self._started: set[int] = set()

    def outcomes(self, meanwhile: Callable[[], object] = lambda: None) -> list[Outcome]:
        """Run all runs, and return one outcome each, in their order. Raise UsageError.

        An interruption ends those that are running. Runs without an outcome then get one that says so. `meanwhile` is
        called once the first have started, when this process only waits.
        """
        self._run(meanwhile)
        return [
            self._outcomes.get(index)
            or without_run(self._runs.loaded(index), self._interruption, is_needless=self._is_needless(index))
            for index in range(len(self._runs))
        ]

    @abstractmethod
    def _run(self, meanwhile: Callable[[], object]) -> None:
        """Run all runs, and finish each that has ended."""

    @abstractmethod
    def _start_no_more(self) -> None:
        """Start no other run: one has not passed."""

    def _is_needless(self, index: int) -> bool:
        return self._runs.is_needless(self._runs.place_and_turn(index)[0])

    def _start(self, index: int) -> None:
        """Report the start of a run, once."""
        if index not in self._started:
            self._started.add(index)
            self._emit(Started(*self._runs.place_and_turn(index), self._runs.name(index)))

    def _finish(self, index: int, outcome: Outcome, key: str | None = None) -> None:
        self._outcomes[index] = outcome
        self._emit(RunEnded(*self._runs.place_and_turn(index), outcome, key))
        if self._runs.fail_fast and outcome.exit_code is not ExitCode.PASSED:
            self._start_no_more()


class _FollowedGate:
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
    """A listener that follows all gates which stop early, and knows the runs that they no longer need.

    The first runs in their order decide a gate. So the verdict is the same with any number of jobs. Runs beyond the
    decision that have ended keep their outcomes.
    """

    def __init__(self, runs: Sequence[LoadedScenario], places: Sequence[int]) -> None:
        """Take the runs of a call and their places in the results; a gate with runs elsewhere is not followed."""
        gates: dict[tuple[str, str], _FollowedGate] = {}
        for run, place in zip(runs, places, strict=True):
            gate = run.source.gate
            if gate is not None and (test := sequential_test(gate)) is not None:
                gates.setdefault((gate.file, gate.name), _FollowedGate(gate, test)).places.append(place)
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
