"""The plan of a call: the scenarios of this shard, the engines of each, and the scenarios that cannot run.

`Runs` are the runs that follow from it; a `Scheduler` runs them, and `EarlyStop` knows the runs that no gate needs.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from collections.abc import Set as AbstractSet
from functools import cached_property
from pathlib import Path

from sim_action.core.errors import ExitCode, InternalError, InvalidScenario, UsageError
from sim_action.core.permissions import Permissions
from sim_action.core.process import Interruption
from sim_action.core.records import dataclass, field, replace
from sim_action.core.statistics import SeenResults, SequentialTest
from sim_action.core.wording import counted
from sim_action.core.yaml_document import KeyPath
from sim_action.engines import ENGINES, chosen, installed
from sim_action.results.artifacts import RunFiles, file_stems
from sim_action.results.gates import result_of, sequential_test
from sim_action.results.journal import Event, Finished, Listener, RunEnded, Started
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Shard
from sim_action.runner.child_outcome import without_run
from sim_action.runner.job import Job
from sim_action.scenario.loading import Libraries, load_all, scenarios_of, shared
from sim_action.scenario.model import ConfidenceKind, LoadedScenario, Unexercised
from sim_action.scenario.selection import Suite, Unmatched
from sim_action.scenario.source import Refused, Source
from sim_action.scenario.variations.gate import PlannedGate


def engine_runs(loaded: LoadedScenario, backend: str | None) -> tuple[LoadedScenario, ...]:
    """Return the scenario once for each of its engines; with several engines, each run is named after its engine.

    `backend`: as typed; None: as the scenario says. Raise InvalidScenario if the file asks for an engine that is not
    installed, UsageError if the command line does.
    """
    if loaded.scenario.robot.is_mjcf:
        return (_on_its_own(loaded, backend),)
    if backend is not None and backend != "all":
        return (_on(loaded, chosen(backend)),)
    if backend == "all":
        return tuple(_on(loaded, engine, named=True) for engine in _several())
    try:
        if loaded.scenario.agreement is None:
            return (_on(loaded, chosen(loaded.scenario.backend)),)
        return tuple(_on(loaded, engine, named=True) for engine in _several())
    except UsageError as error:
        path: KeyPath = ("backend",) if loaded.scenario.agreement is None else ("agreement",)
        raise InvalidScenario([loaded.document.problem(path, str(error))]) from None


def _on_its_own(loaded: LoadedScenario, backend: str | None) -> LoadedScenario:
    """Return the run of a model that only one engine can read. Raise InvalidScenario for other engines."""
    scenario = loaded.scenario
    reader, title = next((name, engine.title) for name, engine in ENGINES.items() if not engine.mjcf_problem)
    if scenario.agreement is not None:
        message = f"{scenario.robot.model} is a model for {title} only: there is no other engine to agree with"
        raise InvalidScenario([loaded.document.problem(("agreement",), message)])
    requested = ENGINES.get(scenario.backend if backend is None else backend)
    if requested is not None and requested.mjcf_problem:
        message = f"{requested.mjcf_problem}; run it on {title}, or convert it to URDF"
        raise InvalidScenario([loaded.document.problem(("robot", "model"), message)])
    try:
        return _on(loaded, chosen(reader))
    except UsageError as error:
        message = f"an .xml file is a model for {title}; {error}"
        raise InvalidScenario([loaded.document.problem(("robot", "model"), message)]) from None


def _several() -> tuple[str, ...]:
    engines = installed()
    if len(engines) < 2:
        missing = "; ".join(engine.install_hint for name, engine in ENGINES.items() if name not in engines)
        only = f"installed: {engines[0]}" if engines else "none is installed"
        raise UsageError(f"a comparison needs two engines; {only} ({missing})")
    return engines


def _on(loaded: LoadedScenario, engine: str, *, named: bool = False) -> LoadedScenario:
    name = f"{loaded.scenario.name} [{engine}]" if named else loaded.scenario.name
    scenario = loaded.scenario.model_copy(update={"backend": engine, "name": name})
    gate = loaded.source.gate
    if named and gate is not None:
        gate = gate.model_copy(update={"name": f"{gate.name} [{engine}]"})
        loaded = replace(loaded, source=replace(loaded.source, gate=gate))
    return replace(loaded, scenario=scenario, compared=named and scenario.is_comparable)


Plan = tuple[LoadedScenario, ...] | Refused
"""A scenario once for each of its engines, with the repetitions of each after it; or its refusal."""


@dataclass(frozen=True, slots=True)
class PlanRequest:
    """The request of the command line; `shard`, `backend` and `seed` as typed.

    `unexercised`, `confidence`: for scenarios that do not say it. `strict`: warnings of the audit make scenarios fail.
    `confidence` is not for gates, which judge many runs.
    """

    suite: Suite
    permissions: Permissions
    shard: str | None
    backend: str | None
    seed: int | None
    unexercised: Unexercised | None = None
    strict: bool = False
    confidence: ConfidenceKind | None = None


@dataclass(frozen=True, slots=True)
class RunPlan:
    """The runs of the call, its shard, and the paths, patterns and tags without a scenario that it reports."""

    plans: Sequence[Plan]
    shard: Shard | None
    empty: Sequence[str]
    unmatched: Sequence[Unmatched] = ()

    @property
    def gates(self) -> tuple[PlannedGate, ...]:
        """The gates of all runs."""
        runs = (run for plan in self.plans for run in ((plan,) if isinstance(plan, Refused) else plan))
        gates = (run.gate if isinstance(run, Refused) else run.source.gate for run in runs)
        return tuple({(gate.file, gate.name): gate for gate in gates if gate is not None}.values())

    @property
    def of_nothing(self) -> list[Outcome]:
        """The error outcomes of the paths, patterns and tags without a scenario."""
        return [*map(Outcome.of_nothing, self.empty), *map(Outcome.of_unmatched, self.unmatched)]


def plan_runs(request: PlanRequest) -> RunPlan:
    """Read all scenarios, select this shard, and check its part. Raise UsageError.

    Variations are checked on every shard, because a problem of one variation can stop all of them: the shard with the
    first one reports it, and no shard runs the others.
    """
    contents = request.suite.read(request.permissions, request.seed)
    # Without any scenario, the exit code reports it.
    empty = request.suite.empty if contents.files else ()
    planner = _Planner(request)
    every = [scenario for several in contents.files.values() for scenario in several]
    # All shards select alike. Numbers select a shard of `matrix`.
    if not request.suite.numbers:
        every = _with_whole_gates(every, request.suite.warn)
    scenarios = scenarios_of(every)
    dealt = [entry for several in scenarios for entry in planner.dealt(several)]
    total = len(dealt) + len(empty) + len(contents.unmatched)
    shard = Shard.parse(request.shard, total) if request.shard is not None else None
    plans = [plan for entry in (shard.dealt(dealt) if shard else dealt) for plan in planner.finished(entry)]
    if shard is not None and shard.index > 1:
        return RunPlan(plans, shard, ())
    return RunPlan(plans, shard, empty, contents.unmatched)


def _with_whole_gates(every: Sequence[Source | Refused], warn: Callable[[str], None]) -> list[Source | Refused]:
    """Return the scenarios; runs count by themselves unless each run of their gate is selected exactly once."""
    selected = Counter((scenario.gate.file, scenario.gate.name) for scenario in every if scenario.gate is not None)
    partial: dict[tuple[str, str], PlannedGate] = {}
    for gate in (scenario.gate for scenario in every if scenario.gate is not None):
        if selected[gate.file, gate.name] != gate.runs:
            partial[gate.file, gate.name] = gate
    for key, gate in partial.items():
        some = counted(selected[key], "run")
        some = f"{some} of {gate.runs}" if selected[key] < gate.runs else f"{some}, more than its {gate.runs},"
        warn(f"the gate of '{gate.name}' is not judged: {some} are selected, and each counts by itself")
    return [
        replace(scenario, gate=None)
        if scenario.gate is not None and (scenario.gate.file, scenario.gate.name) in partial
        else scenario
        for scenario in every
    ]


def source_of(plan: Plan) -> Source | Refused:
    """Return the scenario of a plan, whether it can run or not."""
    return plan if isinstance(plan, Refused) else plan[0].source


class _Planner:
    """Makes plans of scenarios that share the files they read."""

    def __init__(self, request: PlanRequest) -> None:
        self._request = request
        self._libraries = Libraries()

    def dealt(self, several: Sequence[Source | Refused]) -> list[Source | Plan]:
        """Return the items to distribute over shards: all variations of a scenario, checked, or the scenario itself."""
        numbered = self._request.suite.numbered
        mine = [scenario for scenario in several if numbered(scenario)]
        if not (mine and isinstance(mine[0], Source) and mine[0].group is not None):
            return list(mine)
        return [plan for plan in self._plans(several) if numbered(source_of(plan))]

    def finished(self, dealt: Source | Plan) -> Iterable[Plan]:
        """Return the plans of one distributed item."""
        return self._plans([dealt]) if isinstance(dealt, Source) else [dealt]

    def _plans(self, sources: Iterable[Source | Refused]) -> Iterator[Plan]:
        loaded = load_all(sources, self._request.permissions, self._libraries)
        return _once(self._sharing(loaded))

    def _sharing(self, loaded: list[LoadedScenario | Refused]) -> Iterator[Plan]:
        """Yield the plans, of which each shares the equal parts with the one before, and empty the list."""
        loaded.reverse()
        previous: Plan = ()
        while loaded:
            plan = self._plan(loaded.pop())
            if not isinstance(plan, Refused) and not isinstance(previous, Refused) and len(plan) == len(previous):
                plan = tuple(map(shared, plan, previous))
            previous = plan
            yield plan

    def _plan(self, scenario: LoadedScenario | Refused) -> Plan:
        """Return the plan: the scenario once for each of its engines, or its refusal."""
        if isinstance(scenario, Refused):
            return scenario
        try:
            runs = engine_runs(self._overridden(scenario), self._request.backend)
            if all(run.scenario.confidence is None for run in runs):
                return runs
            from sim_action.runner.numerical_confidence import with_repetitions  # a usual run does without it

            return tuple(repeated for run in runs for repeated in with_repetitions(run))
        except InvalidScenario as error:
            return scenario.source.refused(error)
        except UsageError:
            raise
        except Exception as error:  # noqa: BLE001 - the other scenarios have results to give
            return scenario.source.refused(InternalError.of(error))

    def _overridden(self, loaded: LoadedScenario) -> LoadedScenario:
        """Return the scenario with the options of the call that override its keys."""
        request = self._request
        changed: dict[str, object] = {}
        if (seed := loaded.source.overriding_seed(request.seed)) is not None:
            changed["seed"] = seed
        if request.unexercised is not None and loaded.scenario.unexercised is None:
            changed["unexercised"] = request.unexercised
        if request.confidence is not None and loaded.source.gate is None:
            changed["confidence"] = request.confidence
        if changed:
            loaded = replace(loaded, scenario=loaded.scenario.model_copy(update=changed))
        return replace(loaded, strict=True) if request.strict else loaded


def _once(planned: Iterable[Plan]) -> Iterator[Plan]:
    """Yield the plans; equal refusals of several variations are given once."""
    refused = set[tuple[str, str]]()
    for plan in planned:
        if isinstance(plan, Refused):
            if (plan.file, plan.name) in refused:
                continue
            refused.add((plan.file, plan.name))
        yield plan


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
    working_folder: Path = field(default_factory=Path.cwd)  # the folder that reports name files from

    def __len__(self) -> int:
        return len(self.scenarios) * self.repeat

    @cached_property
    def _stems(self) -> Sequence[str]:
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
            working_folder=self.working_folder,
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

        An interruption ends the runs in progress. Runs without an outcome then get one that says so. `meanwhile` is
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
