"""What a run leaves beside its outcome: its trace, its replay, and what there is to be recorded of it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import TYPE_CHECKING

from sim_action.core.messages import escaped_line
from sim_action.runner.job import Job
from sim_action.simulation.recorder import Footage
from sim_action.state.trace_storage import save_trace
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.recording.export.recorded_run import RecordedRun


def store_evidence(job: Job, scene: Scene, footage: Footage) -> tuple[str, ...]:
    """Writes what was kept of a run where it belongs; returns what to say of it. Raises OSError."""
    trace, film = footage.trace(), footage.film()
    if trace is None:
        return ()
    job.trace.parent.mkdir(parents=True, exist_ok=True)
    save_trace(trace, job.trace)
    if job.replay is None or film is None or footage.start is None:
        return ()
    try:
        # What is not asked for is not imported.
        from sim_action.recording.replay.making import make_replay

        make_replay(job.loaded.scenario, scene, footage.start, film, job.replay)
    except Exception as error:  # noqa: BLE001 - a run has its verdict, whether there is a picture of it or not
        return (f"there is no replay of it: {escaped_line(str(error))}",)
    return ()


def to_record(job: Job, scene: Scene, footage: Footage) -> Iterator[RecordedRun]:
    """The run for recordings, if they are asked for, there is something of it, and it fits into memory."""
    if not job.recordings:
        return
    from sim_action.recording.export.recorded_run import RecordedRun

    with suppress(MemoryError):
        trace, film = footage.trace(), footage.film()
        if trace is not None and film is not None:
            yield RecordedRun.of(scene, film, trace, job.loaded.scenario.sensors, footage.twists())
