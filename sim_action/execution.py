"""Runs many scenarios, each in a child process of its own, some at the same time; each ends with an outcome."""

from __future__ import annotations

import os
import re
import select
import signal
import tempfile
import time
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from types import FrameType
from typing import Final, Protocol, Self

from pydantic import ValidationError

from sim_action.backends import BACKENDS
from sim_action.isolation import CAN_FORK, Child
from sim_action.native_output import muted, split_output
from sim_action.outcome import Failure, FailureKind, Outcome
from sim_action.scenario import LoadedScenario
from sim_action.simulation import ENGINE
from sim_action.worker import Job

TRACE_FOLDER: Final = "traces"

_MOST_OUTPUT: Final = 64_000
_MOST_LAST_WORDS: Final = 2_000
_MOST_OUTCOME: Final = 50_000_000
# The end of a child shows on its pipe at once, and in the process table a moment later; a grandchild may hold the pipe.
_ENDING_WAIT: Final = 0.002
_LONGEST_WAIT: Final = 0.25


class Listener(Protocol):
    """Who is told how it goes."""

    def progress(self, name: str, sim_time: float, real_time_factor: float) -> None:
        """A scenario has come to a sim time, in s."""

    def finished(self, outcome: Outcome) -> None:
        """A scenario is over."""


def execute(scenarios: Sequence[LoadedScenario], folder: Path, jobs: int, listener: Listener) -> list[Outcome]:
    """Runs all scenarios, at most `jobs` at a time; traces go below `folder`. One outcome each, in their order.

    Ctrl-C and SIGTERM end what runs; scenarios without an outcome then get one that says so.
    """
    if CAN_FORK and any(not loaded.scenario.runs_user_code for loaded in scenarios):
        _warm_up()
    with tempfile.TemporaryDirectory(prefix="sim-action-") as scratch:
        paths = trace_paths([loaded.scenario.name for loaded in scenarios], folder)
        waiting = deque(
            (index, Job(loaded, path, folder, _subfolder(Path(scratch), index)))
            for index, (loaded, path) in enumerate(zip(scenarios, paths, strict=True))
        )
        outcomes = _Scheduler(waiting, jobs, listener).run()
    return [outcomes.get(index) or _interrupted(loaded) for index, loaded in enumerate(scenarios)]


def trace_paths(names: Sequence[str], folder: Path) -> list[Path]:
    """A file for each name, safe on every file system, no two alike whatever the case."""
    taken: set[str] = set()
    paths = []
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9._-]+", "-", name).strip("-.")[:80] or "scenario"
        unique, number = plain, 1
        while unique.lower() in taken:
            number += 1
            unique = f"{plain}-{number}"
        taken.add(unique.lower())
        paths.append(folder / TRACE_FOLDER / f"{unique}.npz")
    return paths


def _subfolder(scratch: Path, index: int) -> Path:
    folder = scratch / str(index)
    folder.mkdir()
    return folder


def _warm_up() -> None:
    """Imports the engine once for all children."""
    with muted():
        BACKENDS.load(ENGINE)


class _Scheduler:
    """One thread, a queue of jobs, and the children that run."""

    def __init__(self, waiting: deque[tuple[int, Job]], jobs: int, listener: Listener) -> None:
        self._waiting = waiting
        self._jobs = jobs
        self._listener = listener
        self._running: dict[int, Child] = {}
        self._outcomes: dict[int, Outcome] = {}

    def run(self) -> dict[int, Outcome]:
        """Outcomes by index; those of an interrupted call are missing."""
        with _Interruption() as interruption:
            while (self._waiting or self._running) and not interruption.happened:
                self._start()
                self._wait(interruption)
                self._collect()
            for child in self._running.values():
                child.kill()
                child.close()
        return self._outcomes

    def _start(self) -> None:
        while self._waiting and len(self._running) < self._jobs:
            index, job = self._waiting.popleft()
            self._running[index] = Child.start(job)

    def _wait(self, interruption: _Interruption) -> None:
        nearest = min(_deadline(child) for child in self._running.values()) - time.monotonic()
        descriptors = [child.progress for child in self._running.values() if not child.silent]
        ending = len(descriptors) < len(self._running)
        descriptors.append(interruption.descriptor)
        select.select(descriptors, [], [], min(_ENDING_WAIT if ending else _LONGEST_WAIT, max(0.0, nearest)))

    def _collect(self) -> None:
        for index, child in list(self._running.items()):
            child.listen()
            status = child.poll()
            if status is None and time.monotonic() < _deadline(child):
                elapsed = time.monotonic() - child.started
                self._listener.progress(child.job.loaded.scenario.name, child.sim_time, child.sim_time / elapsed)
                continue
            if status is None:
                child.kill()
            child.close()
            del self._running[index]
            self._outcomes[index] = outcome = _outcome_of(child, status)
            self._listener.finished(outcome)


def _deadline(child: Child) -> float:
    return child.started + child.job.loaded.scenario.wall_seconds


class _Interruption:
    """Ctrl-C, or the SIGTERM of a cancelled workflow. It is noticed between two steps of the scheduler, not within one.

    An exception out of a signal handler could come between the birth of a child and its being known.
    """

    def __init__(self) -> None:
        self.happened = False
        self.descriptor, self._written_to = os.pipe()
        os.set_blocking(self._written_to, False)

    def __enter__(self) -> Self:
        self._wakeup = signal.set_wakeup_fd(self._written_to)
        self._handlers = {number: signal.signal(number, self._notice) for number in (signal.SIGINT, signal.SIGTERM)}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(self._wakeup)
        os.close(self.descriptor)
        os.close(self._written_to)

    def _notice(self, _number: int, _frame: FrameType | None) -> None:
        self.happened = True


def _outcome_of(child: Child, status: int | None) -> Outcome:
    """What the child wrote; if it did not come to that, what became of it."""
    diagnostics, output = split_output(_tail(child.job.output_file))
    outcome = _written(child) if status == 0 else None
    if outcome is None:
        outcome = _without_verdict(child.job.loaded, _failure(child, status, output))
    return outcome.model_copy(
        update={
            "diagnostics": diagnostics,
            "output": output,
            "wall_time": time.monotonic() - child.started,
        }
    )


def _written(child: Child) -> Outcome | None:
    path = child.job.outcome_file
    try:
        if path.stat().st_size > _MOST_OUTCOME:
            return None
        return Outcome.model_validate_json(path.read_bytes())
    except (OSError, ValidationError):
        return None


def _failure(child: Child, status: int | None, output: str) -> Failure:
    scenario, last_words = child.job.loaded.scenario, output[-_MOST_LAST_WORDS:]
    at = f"sim time had come to {child.sim_time:.2f} s"
    kind: FailureKind = "crash"
    if status is None:
        kind, title = "wall limit", "wall limit"
        limit = f"no verdict after {scenario.wall_seconds:g} s of wall time"
        message = f"{limit}; {at}; a stuck controller, or too low a wall_limit"
    elif status < 0:
        title = _signal_name(-status)
        message = f"the process of this scenario was ended by {title}; {at}"
    else:
        title = f"exit {status}"
        message = f"the process of this scenario ended by itself, with exit code {status} and no verdict; {at}"
    return Failure(kind=kind, title=title, message=message, details=last_words)


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def _interrupted(loaded: LoadedScenario) -> Outcome:
    message = "the run was interrupted before this scenario was over"
    return _without_verdict(loaded, Failure(kind="interrupted", title="interrupted", message=message))


def _without_verdict(loaded: LoadedScenario, failure: Failure) -> Outcome:
    return Outcome(name=loaded.scenario.name, file=loaded.file, status="error", failures=(failure,))


def _tail(path: Path) -> str:
    try:
        with path.open("rb") as file:
            file.seek(max(0, path.stat().st_size - _MOST_OUTPUT))
            return file.read().decode("utf-8", errors="replace")
    except OSError:
        return ""
