"""The functions that run in the worker processes of Dask: they keep copies of workspaces, and run tasks."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any, Final

from distributed import get_worker

from sim_action.core.errors import SimActionError
from sim_action.core.records import dataclass
from sim_action.results.journal import Event, Progressed, Started
from sim_action.runner.cluster.task import Result, Task, run_task, software
from sim_action.runner.cluster.workspace_archive import Archive, unpack
from sim_action.scenario.loading import Libraries

_PROGRESS_PERIOD_S: Final = 0.5

_LIBRARIES: Final[dict[tuple[str, ...], Libraries]] = {}
"""Digests of copies -> the models in them that earlier tasks have read."""

_LOADING: Final = threading.Lock()


@dataclass(frozen=True, slots=True)
class Reply:
    """The answer of a worker."""

    worker: str  # its address
    results: tuple[Result, ...] = ()  # what the runs gave; none if there was no run
    lacks: tuple[str, ...] = ()  # digests of copies that must be sent first
    refusal: str = ""  # the reason why the runs cannot take place here


@dataclass(frozen=True, slots=True)
class Report:
    """The progress of a task, which is sent as a tuple of its attributes."""

    task: str  # the key of the task at Dask
    index: int  # the run's index among all runs of the call
    worker: str  # its address
    progress: tuple[float, float] | None  # the sim time and the real time factor of the run; None: the run begins


class CancelledError(Exception):
    """The caller does not want the result any more."""


def receive(archive: Archive, dask_worker: Any) -> None:
    """Take the copy of a workspace; Dask passes the worker. Raises OSError."""
    unpack(archive, _copies(dask_worker))


def perform(task: Task, topic: str) -> Reply:
    """Run a task in this worker. `topic`: where the caller hears a `Report` at its start, and of its progress."""
    worker = get_worker()
    if differences := "; ".join(software(tuple(dict(task.software.engines))).differences(task.software)):
        return Reply(worker.address, refusal=f"its software is another one: {differences}")
    copies = _copies(worker)
    if lacks := tuple(copied.digest for copied in task.copied if not (copies / copied.digest).exists()):
        return Reply(worker.address, lacks=lacks)
    key = worker.get_current_task()

    def tell(place: int, progress: tuple[float, float] | None) -> None:
        worker.log_event(topic, (key, task.runs[place].index, worker.address, progress))

    # Loading may end this worker, too.
    tell(0, None)
    told_at = time.monotonic()

    def listen(event: Event) -> None:
        nonlocal told_at
        running = worker.state.tasks.get(key)
        # Dask cannot end a thread: the run ends from inside.
        if running is None or running.state == "cancelled":
            raise CancelledError
        if isinstance(event, Started) and event.place > 0:
            tell(event.place, None)
        elif isinstance(event, Progressed) and time.monotonic() - told_at >= _PROGRESS_PERIOD_S:
            told_at = time.monotonic()
            tell(event.place, (event.sim_time, event.real_time_factor))

    digests = tuple(copied.digest for copied in task.copied)
    with _LOADING:
        libraries = _LIBRARIES.setdefault(digests, Libraries())
    try:
        return Reply(worker.address, run_task(task, copies, libraries, Path(worker.local_directory), listen))
    except (SimActionError, OSError, MemoryError) as error:
        return Reply(worker.address, refusal=str(error))


def _copies(worker: Any) -> Path:
    return Path(worker.local_directory, "sim-action")
