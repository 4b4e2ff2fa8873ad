"""The pool of child processes: it runs many scenarios, several at a time, and returns an outcome for each."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from collections.abc import Set as AbstractSet
from contextlib import suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Final

from sim_action.core.errors import ExitCode
from sim_action.core.process import Interruption
from sim_action.core.records import replace
from sim_action.engines import ENGINES, chosen
from sim_action.recording.export import EXPORTS
from sim_action.results.events import Listener, Progressed, RunEnded, Started
from sim_action.results.outcome import ExpectationOutcome, Outcome
from sim_action.results.output_folder import remove_unfinished_files
from sim_action.runner.child_outcome import (
    Ending,
    Limit,
    engine_provenance,
    inputs_of,
    not_started,
    outcome_of,
    refusal_of,
    without_run,
)
from sim_action.runner.isolation import child_type_here
from sim_action.runner.isolation.capacity import cause_of, most_children
from sim_action.runner.isolation.child_process import ChildProcess, Starter
from sim_action.runner.job import Job, JobList, JobOrder
from sim_action.runner.process_output import muted
from sim_action.runner.run_keys import RunKeys
from sim_action.scenario.model import LoadedScenario

# The pipe of a child closes at once, but the process table follows later; a grandchild may keep the pipe open.
_ENDING_WAIT_S: Final = 0.002
# The journal waits for the disk at events, which come at least this often while children run.
_MAX_WAIT_S: Final = 0.1
# If nothing runs, another process may have what a start needs, for a moment.
_MAX_ATTEMPTS: Final = 5
_ATTEMPT_PAUSE_S: Final = 0.2


def execute(
    scenarios: Sequence[LoadedScenario],
    folder: Path,
    jobs: int,
    emit: Listener,
    interruption: Interruption,
    *,
    places: Sequence[int] | None = None,
    fail_fast: bool = False,
    replays: bool = False,
    formats: Sequence[str] = (),
    repeat: int = 1,
    motions: Path | None = None,
    ended: AbstractSet[tuple[int, int]] = frozenset(),
    needless: Callable[[int], bool] = lambda _: False,
    keys: RunKeys | None = None,
    child_type: type[ChildProcess] | None = None,
    shares: bool = True,
    meanwhile: Callable[[], object] = lambda: None,
) -> list[Outcome]:
    """Run all scenarios, and return one outcome each, in their order.

    An interruption ends the running children; scenarios without an outcome then get one that says so.

    Args:
        scenarios: the scenarios to run.
        folder: the folder of the results; traces are written below it.
        jobs: the number of child processes that may run at the same time.
        emit: receives the events of the runs, from `Started` to `RunEnded`.
        interruption: ends the call early.
        places: the index in the results for each scenario; by default, that in `scenarios`.
        fail_fast: start no scenario after the first one that has not passed.
        replays: write replays, too.
        formats: the formats of recordings to write.
        repeat: how often the whole list is run, one time after the other; if more than once, each run has its own
            interpreter and its own seed of hashes.
        motions: the folder for the motion of runs that are compared, see `job.motion_file`.
        ended: the place and the turn of each run that an earlier call has ended; they get no process.
        needless: returns True for a place in the results if its run need not start any more.
        keys: gives the keys of runs; by default, they have none.
        child_type: how child processes are started; by default, as this system allows.
        shares: several runs without user code may use one child process, where the system allows it.
        meanwhile: called once the first children run, when this process only waits.

    Raises UsageError.
    """
    child_type = child_type or child_type_here()
    for loaded in scenarios:
        chosen(loaded.scenario.backend)
    numbered = [(place, turn) for turn in range(1, repeat + 1) for place in places or range(len(scenarios))]
    left = [loaded for index, loaded in enumerate(scenarios) if numbered[index] not in ended]
    is_warm = child_type.forks and repeat == 1 and _warmed_up(left, formats, replays=replays)
    order = JobOrder.of(
        scenarios,
        folder,
        repeat=repeat,
        memory_is_limited=child_type.limits_memory,
        replays=replays,
        formats=formats,
        is_fresh=not is_warm,
        motions=motions,
    )
    every = JobList(order.job, len(numbered))
    waiting = deque(index for index in range(len(numbered)) if numbered[index] not in ended)
    is_shared = shares and is_warm and len(waiting) > 1
    scheduler = _Scheduler(
        child_type.starter(every) if is_shared else Starter(child_type),
        every,
        most_children(child_type, jobs),
        emit,
        interruption,
        waiting=waiting,
        places_and_turns=numbered,
        fail_fast=fail_fast,
        needless=needless,
        keys=keys,
    )
    try:
        outcomes = scheduler.run(partial(_make_ready, scenarios, meanwhile))
    finally:
        # Child processes that were killed leave them.
        remove_unfinished_files(folder)
    every_run = zip(numbered, [*scenarios] * repeat, strict=True)
    return [
        outcomes.get(index) or without_run(loaded, interruption, is_needless=needless(place))
        for index, ((place, _), loaded) in enumerate(every_run)
    ]


def _warmed_up(scenarios: Sequence[LoadedScenario], formats: Iterable[str], *, replays: bool) -> bool:
    """Prepare this process for forks; return False if the system refuses it, such as for a lack of descriptors.

    An interpreter of its own then runs each scenario: a package that was imported in part may not be imported again.
    """
    forked = [loaded for loaded in scenarios if not loaded.scenario.runs_user_code]
    try:
        warm_up(forked, formats, replays=replays, preloads=len(forked) > 1)
    except (OSError, ImportError, MemoryError):
        return False
    return True


def warm_up(
    scenarios: Sequence[LoadedScenario], formats: Iterable[str], *, replays: bool, preloads: bool = True
) -> None:
    """Import and prepare, once for all forks, the engines and the packages that write results.

    `preloads`: modules that only some runs need, too. Raises OSError, ImportError, MemoryError.
    """
    ExpectationOutcome.model_rebuild()
    Outcome.model_rebuild()
    if replays:
        from sim_action.recording.replay import build

        build.warm_up(loaded.model for loaded in scenarios if loaded.model is not None)
    with muted():
        for engine in {chosen(loaded.scenario.backend) for loaded in scenarios}:
            ENGINES[engine].load().warm_up()
    if preloads:
        from sim_action.simulation.preloading import preload

        preload(scenarios)
    for package in (package for name in formats if scenarios for package in EXPORTS.load(name).packages):
        import_module(package)


def _make_ready(scenarios: Iterable[LoadedScenario], meanwhile: Callable[[], object]) -> None:
    """Look up once what all outcomes share, and call `meanwhile`.

    If the system refuses either, such as for a lack of descriptors, it is done again when it is needed.
    """
    with suppress(OSError, ImportError):
        for backend in {loaded.scenario.backend for loaded in scenarios}:
            engine_provenance(backend)
        meanwhile()


class _Scheduler:
    """The scheduler of the pool: one thread, a queue of jobs, and the running child processes."""

    def __init__(
        self,
        starter: Starter,
        every: Sequence[Job],
        jobs: int,
        emit: Listener,
        interruption: Interruption,
        *,
        waiting: deque[int],
        places_and_turns: Sequence[tuple[int, int]],
        fail_fast: bool,
        needless: Callable[[int], bool],
        keys: RunKeys | None,
    ) -> None:
        self._starter = starter
        self._every = every
        self._fail_fast, self._needless = fail_fast, needless
        self._interruption = interruption
        self._waiting = waiting
        # These runs have started before, in child processes that others had used.
        self._repeated: set[int] = set()
        self._jobs = jobs
        self._attempts = _MAX_ATTEMPTS
        self._starts_more = True
        self._places_and_turns = places_and_turns
        self._emit = emit
        self._keys = keys
        self._running: dict[int, ChildProcess] = {}
        self._outcomes: dict[int, Outcome] = {}

    def run(self, meanwhile: Callable[[], object]) -> dict[int, Outcome]:
        """Return outcomes by index; scenarios that did not start or end have none."""
        try:
            self._start()
            meanwhile()
            while not self._interruption.happened:
                self._start()
                # An interruption inside `_start` leaves nothing to wait for.
                if not self._running:
                    break
                self._wait()
                self._collect()
        finally:
            # No child process outlives the call.
            for child in self._running.values():
                child.kill()
                child.close()
            self._starter.end_waiting()
        return self._outcomes

    def _start(self) -> None:
        while self._waiting and len(self._running) < self._jobs and not self._interruption.happened:
            index = self._waiting.popleft()
            if self._needless(self._places_and_turns[index][0]):
                continue
            job = self._every[index]
            deadline = time.monotonic() + job.loaded.scenario.wall_seconds
            alone, most_waiting = index in self._repeated, self._jobs - len(self._running) - 1
            try:
                self._running[index] = self._starter.start(
                    index, replace(job, deadline=deadline), alone=alone, most_waiting=most_waiting
                )
            except (OSError, MemoryError) as error:
                self._put_back(index, error)
            else:
                if not alone:
                    self._emit(Started(*self._places_and_turns[index], job.loaded.scenario.name))

    def _put_back(self, index: int, error: OSError | MemoryError) -> None:
        """Start a job again once another one has ended, or soon if none runs; at last it is an error."""
        # They may have what a start needs.
        self._starter.end_waiting()
        if not self._running:
            self._attempts -= 1
            if self._attempts <= 0:
                self._finish(index, not_started(self._every[index].loaded, cause_of(error)))
                return
            self._interruption.wait(_ATTEMPT_PAUSE_S)
        if self._starts_more or index in self._repeated:
            self._waiting.appendleft(index)
        # Fewer at the same time take less.
        self._jobs = max(1, len(self._running))

    def _wait(self) -> None:
        nearest = min(_deadline(child) for child in self._running.values()) - time.monotonic()
        heard = [child.progress for child in self._running.values() if not child.silent]
        ending = len(heard) < len(self._running)
        self._interruption.wait(min(_ENDING_WAIT_S if ending else _MAX_WAIT_S, max(0.0, nearest)), *heard)

    def _collect(self) -> None:
        for index, child in list(self._running.items()):
            child.listen()
            ending: Ending | None = child.poll()
            if ending is None:
                ending = _exceeded(child)
                if ending is not None:
                    child.kill()
            if ending is None:
                # The clock of Windows may stand still for 16 ms.
                elapsed = max(_ENDING_WAIT_S, time.monotonic() - child.started)
                place, turn = self._places_and_turns[index]
                name = child.job.loaded.scenario.name
                self._emit(Progressed(place, turn, name, child.sim_time, child.sim_time / elapsed))
                continue
            child.close()
            del self._running[index]
            if child.is_doubtful:
                self._repeated.add(index)
                self._waiting.appendleft(index)
                continue
            if (refusal := refusal_of(child, ending)) is not None:
                self._put_back(index, refusal)
                continue
            self._attempts = _MAX_ATTEMPTS
            outcome = outcome_of(child, ending)
            self._finish(index, outcome, self._key(child, outcome))

    def _key(self, child: ChildProcess, outcome: Outcome) -> str | None:
        if self._keys is None or not outcome.has_verdict:
            return None
        return self._keys.of(child.job.loaded, inputs_of(child))

    def _finish(self, index: int, outcome: Outcome, key: str | None = None) -> None:
        self._outcomes[index] = outcome
        self._emit(RunEnded(*self._places_and_turns[index], outcome, key))
        if self._fail_fast and outcome.exit_code is not ExitCode.PASSED:
            self._starts_more = False
            self._waiting = deque(index for index in self._waiting if index in self._repeated)


def _deadline(child: ChildProcess) -> float:
    begun = child.started if child.judged is None else child.judged
    return begun + child.job.loaded.scenario.wall_seconds


def _exceeded(child: ChildProcess) -> Limit | None:
    if time.monotonic() >= _deadline(child):
        return "wall limit"
    return "output limit" if child.printed > child.job.loaded.scenario.output_bytes else None
