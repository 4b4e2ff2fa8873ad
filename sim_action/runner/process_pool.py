"""The pool of child processes: it runs many scenarios, several at a time, and returns an outcome for each."""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from functools import partial
from importlib import import_module
from typing import Final

from typing_extensions import override

from sim_action.core.process import Interruption
from sim_action.core.records import dataclass, replace
from sim_action.engines import ENGINES, chosen
from sim_action.recording.export import EXPORTS
from sim_action.results.journal import Listener, Progressed
from sim_action.results.outcome import ExpectationOutcome, Outcome, Scope
from sim_action.results.output_folder import remove_unfinished_files
from sim_action.runner.child_outcome import (
    Ending,
    Limit,
    engine_provenance,
    inputs_of,
    not_started,
    outcome_of,
    refusal_of,
)
from sim_action.runner.isolation.child_process import ChildProcess, Starter, cause_of, most_children
from sim_action.runner.process_output import muted
from sim_action.runner.run_keys import RunKeys
from sim_action.runner.run_plan import Runs, Scheduler
from sim_action.scenario.model import LoadedScenario

# The pipe of a child closes at once, but the process table follows later; a grandchild may keep the pipe open.
_ENDING_WAIT_S: Final = 0.002
_MAX_WAIT_S: Final = 0.1  # the journal waits for the disk at events, which come at least this often while children run
# If nothing runs, another process may have what a start needs, for a moment.
_MAX_ATTEMPTS: Final = 5
_ATTEMPT_PAUSE_S: Final = 0.2


@dataclass(frozen=True, slots=True)
class PoolOptions:
    """The options of a pool."""

    jobs: int = 1  # the number of child processes that may run at the same time
    keys: RunKeys | None = None  # gives the keys of runs; None: they have none
    child_type: type[ChildProcess] | None = None  # how child processes are started; None: as this system allows
    shares: bool = True  # several runs without user code may use one child process, where the system allows it


def child_type_here() -> type[ChildProcess]:
    """Return the type of child processes for this system; no other code chooses."""
    if sys.platform == "linux":
        from sim_action.runner.isolation.linux_child import LinuxChild  # needs modules of Linux

        return LinuxChild
    from sim_action.runner.isolation.portable_child import PortableChild  # only other systems need it

    return PortableChild


def _warmed_up(scenarios: Sequence[LoadedScenario], formats: Iterable[str], *, replays: bool) -> bool:
    """Prepare this process for forks; False if the system refuses: each run then gets a new interpreter."""
    forked = [loaded for loaded in scenarios if not loaded.scenario.runs_user_code]
    try:
        warm_up(forked, formats, replays=replays, preloads=len(forked) > 1)
    except (OSError, ImportError, MemoryError):
        return False
    return True


def warm_up(
    scenarios: Sequence[LoadedScenario], formats: Iterable[str], *, replays: bool, preloads: bool = True
) -> None:
    """Import what all forks need; `preloads`: what few of them need, too. Raises OSError, ImportError, MemoryError."""
    for model in (Scope, ExpectationOutcome, Outcome):
        model.model_rebuild()
    if replays:
        from sim_action.recording.replay import build  # a run without a report does without it

        build.warm_up(loaded.model for loaded in scenarios if loaded.model is not None)
    with muted():
        for engine in {chosen(loaded.scenario.backend) for loaded in scenarios}:
            ENGINES[engine].load().warm_up()
    if preloads:
        from sim_action.simulation.preloading import preload  # a usual run does without it

        preload(scenarios)
    for package in (package for name in formats if scenarios for package in EXPORTS.load(name).packages):
        import_module(package)


class Pool(Scheduler):
    """Runs scenarios in child processes: one thread, a queue of runs, and the children."""

    def __init__(self, runs: Runs, emit: Listener, interruption: Interruption, options: PoolOptions) -> None:
        """Take the runs, and prepare this process for its children. Raise UsageError for an engine that is missing."""
        super().__init__(runs, emit, interruption)
        child_type = options.child_type or child_type_here()
        for loaded in runs.scenarios:
            chosen(loaded.scenario.backend)
        self._waiting = deque(runs.waiting)
        left = [runs.loaded(index) for index in self._waiting]
        is_warm = child_type.forks and runs.repeat == 1 and _warmed_up(left, runs.formats, replays=runs.replays)
        self._job = partial(runs.job, memory_is_limited=child_type.limits_memory, is_fresh=not is_warm)
        is_shared = options.shares and is_warm and len(self._waiting) > 1
        self._starter = child_type.starter(self._job) if is_shared else Starter(child_type)
        self._jobs = most_children(child_type, options.jobs)
        self._keys = options.keys
        # These runs have started before, in child processes that others had used.
        self._repeated: set[int] = set()
        self._attempts = _MAX_ATTEMPTS
        self._starts_more = True
        self._running: dict[int, ChildProcess] = {}

    @override
    def _run(self, meanwhile: Callable[[], object]) -> None:
        try:
            self._start_waiting()
            # Look up what outcomes share, and call `meanwhile`; after a refusal of the system, it is done when needed.
            with suppress(OSError, ImportError):
                for backend in {loaded.scenario.backend for loaded in self._runs.scenarios}:
                    engine_provenance(backend)
                meanwhile()
            while not self._interruption.happened:
                self._start_waiting()
                # An interruption inside `_start_waiting` leaves nothing to wait for.
                if not self._running:
                    break
                nearest = min(_deadline(child) for child in self._running.values()) - time.monotonic()
                heard = [child.progress for child in self._running.values() if not child.silent]
                ending = len(heard) < len(self._running)
                self._interruption.wait(min(_ENDING_WAIT_S if ending else _MAX_WAIT_S, max(0.0, nearest)), *heard)
                self._collect()
        finally:
            # No child process outlives the call.
            for child in self._running.values():
                child.kill()
                child.close()
            self._starter.end_waiting()
            # Child processes that were killed leave them.
            remove_unfinished_files(self._runs.folder)

    def _start_waiting(self) -> None:
        while self._waiting and len(self._running) < self._jobs and not self._interruption.happened:
            index = self._waiting.popleft()
            if self._is_needless(index):
                continue
            job = self._job(index)
            deadline = time.monotonic() + job.loaded.scenario.wall_seconds
            alone, most_waiting = index in self._repeated, self._jobs - len(self._running) - 1
            try:
                self._running[index] = self._starter.start(
                    index, replace(job, deadline=deadline), alone=alone, most_waiting=most_waiting
                )
            except (OSError, MemoryError) as error:
                self._put_back(index, error)
            else:
                self._start(index)

    def _put_back(self, index: int, error: OSError | MemoryError) -> None:
        """Start a job again once another one has ended, or soon if none runs; at last it is an error."""
        # They may have what a start needs.
        self._starter.end_waiting()
        if not self._running:
            self._attempts -= 1
            if self._attempts <= 0:
                self._finish(index, not_started(self._runs.loaded(index), cause_of(error)))
                return
            self._interruption.wait(_ATTEMPT_PAUSE_S)
        if self._starts_more or index in self._repeated:
            self._waiting.appendleft(index)
        # Fewer at the same time take less.
        self._jobs = max(1, len(self._running))

    def _collect(self) -> None:
        for index, child in list(self._running.items()):
            child.listen()
            ending: Ending | None = child.poll()
            if ending is None:
                ending = _exceeded(child)
                if ending is not None:
                    child.kill()
            if ending is None:
                # Windows clocks tick every 16 ms.
                elapsed = max(_ENDING_WAIT_S, time.monotonic() - child.started)
                run = (*self._runs.place_and_turn(index), self._runs.name(index))
                self._emit(Progressed(*run, child.sim_time, child.sim_time / elapsed))
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

    @override
    def _start_no_more(self) -> None:
        self._starts_more = False
        self._waiting = deque(index for index in self._waiting if index in self._repeated)


def _deadline(child: ChildProcess) -> float:
    begun = child.started if child.judged is None else child.judged
    return begun + child.job.loaded.scenario.wall_seconds


def _exceeded(child: ChildProcess) -> Limit | None:
    if time.monotonic() >= _deadline(child):
        return "wall limit"
    return "output limit" if child.printed > child.job.loaded.scenario.output_bytes else None
