"""The evidence of a run: its trace, replay, motion and recordings. The verdict does not depend on them.

Evidence that cannot be written, for example because the disk is full, is a note.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from sim_action.core.errors import InternalError
from sim_action.core.records import replace
from sim_action.core.wording import escaped_line, system_reason
from sim_action.runner.job import Job
from sim_action.simulation.recorder import RunRecorder
from sim_action.state.trace_storage import save_trace
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.recording.export.recorded_run import RecordedRun


def remove_earlier(job: Job) -> None:
    """Remove the evidence of an earlier run in the same place, as far as possible."""
    for path in job.evidence:
        with suppress(OSError):
            path.unlink(missing_ok=True)


def store_evidence(job: Job, scene: Scene, footage: RunRecorder) -> tuple[str, ...]:
    """Write the trace, the replay and the motion of a run, as far as they are asked for; return notes."""
    notes: list[str] = []
    with _noted("trace", notes):
        if (trace := footage.trace()) is not None:
            if not job.trace.parent.is_dir():
                job.trace.parent.mkdir(parents=True, exist_ok=True)
            save_trace(trace, job.trace)
    with _noted("replay", notes):
        if job.replay is not None and (film := footage.film()) is not None and footage.start is not None:
            # Imported only if it is needed.
            from sim_action.recording.replay.build import make_replay

            scenario, start = job.loaded.scenario, footage.start
            commanded, readings = footage.commanded(), footage.readings
            make_replay(scenario, scene, start, film, job.replay, commanded=commanded, readings=readings)
    with _noted("motion", notes, "it is not compared with that in another engine"):
        if job.motion is not None and (motion := footage.motion(scene)) is not None:
            motion.save(job.motion)
    return tuple(notes)


@contextmanager
def _noted(name: str, notes: list[str], effect: str = "") -> Iterator[None]:
    """Turn each error of this context into a note: the name of the file, the reason, and the effect."""
    try:
        yield
    except Exception as error:  # noqa: BLE001 - the verdict does not depend on evidence
        is_expected = isinstance(error, OSError | ValueError | MemoryError)
        reason = system_reason(error) if is_expected else str(InternalError.of(error))
        notes.append(f"{name}: {escaped_line(reason)}{effect and '; '}{effect}")


def run_to_record(job: Job, scene: Scene, footage: RunRecorder) -> Iterator[RecordedRun]:
    """Yield the run for recordings, if they are asked for, it has data, and it fits into memory."""
    if not job.recordings:
        return
    from sim_action.recording.export.recorded_run import RecordedRun

    with suppress(MemoryError):
        trace, film = footage.trace(), footage.film()
        if trace is not None and film is not None:
            run = RecordedRun.of(scene, film, trace, job.loaded.scenario, footage.twists())
            yield replace(run, wrenches=footage.wrenches())
