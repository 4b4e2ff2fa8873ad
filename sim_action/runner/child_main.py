"""The code that runs inside the child process of one scenario: simulate, write the outcome as data, exit."""

from __future__ import annotations

import mmap
import os
import pickle
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final, NoReturn

from sim_action.commands import COMMANDS
from sim_action.core.discovery import file_name
from sim_action.core.errors import (
    BadSource,
    BadStart,
    EngineError,
    InternalError,
    InvalidScenario,
    Location,
    MissedContact,
    ModelError,
    Problem,
    RefusedModel,
    RunError,
    ScriptError,
    SimulationUnstable,
)
from sim_action.core.files import whole_file
from sim_action.core.wording import escaped_line
from sim_action.core.workspace import Permissions
from sim_action.core.yaml_document import Document, KeyPath
from sim_action.results.outcome import ExpectationOutcome, Failure, FailureKind, Outcome, Scope, status_of
from sim_action.runner.job import JUDGED, Job, out_of_memory
from sim_action.runner.process_output import dump_stack_before, redirect_output
from sim_action.scenario.loading import build_scene, checked
from sim_action.scenario.model import LoadedScenario, Scenario
from sim_action.simulation.loop import SimulationRun, simulate
from sim_action.simulation.recorder import RunRecorder
from sim_action.state.trace_storage import save_trace
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.recording.export.recorded_run import RecordedRun


def store_artifacts(job: Job, scene: Scene, footage: RunRecorder) -> tuple[str, ...]:
    """Write the trace and the replay of a run to their places, and return notes. Raise OSError."""
    trace, film = footage.trace(), footage.film()
    if trace is None:
        return ()
    job.trace.parent.mkdir(parents=True, exist_ok=True)
    save_trace(trace, job.trace)
    if job.replay is None or film is None or footage.start is None:
        return ()
    try:
        # Imported only if it is needed.
        from sim_action.recording.replay.build import make_replay

        make_replay(job.loaded.scenario, scene, footage.start, film, job.replay)
    except Exception as error:  # noqa: BLE001 - the verdict does not depend on the replay
        return (f"no replay was written: {escaped_line(str(error))}",)
    return ()


def _store_motion(job: Job, scene: Scene, footage: RunRecorder) -> Iterator[str]:
    """Write the motion at every step if it is compared; yield a note if this is impossible."""
    if job.motion is None:
        return
    try:
        motion = footage.motion(scene)
        if motion is not None:
            motion.save(job.motion)
    except (OSError, MemoryError) as error:
        # The verdict does not depend on the comparison.
        reason = escaped_line(str(error) or type(error).__name__)
        yield f"the motion was not stored, so it is not compared with that in another engine: {reason}"


def to_record(job: Job, scene: Scene, footage: RunRecorder) -> Iterator[RecordedRun]:
    """Yield the run for recordings, if they are asked for, it has data, and it fits into memory."""
    if not job.recordings:
        return
    from sim_action.recording.export.recorded_run import RecordedRun

    with suppress(MemoryError):
        trace, film = footage.trace(), footage.film()
        if trace is not None and film is not None:
            yield RecordedRun.of(scene, film, trace, job.loaded.scenario.sensors, footage.twists())


_PROGRESS_PERIOD_S: Final = 0.1
_RESERVE_BYTES: Final = 32 << 20  # bytes of address space; nothing is written there


def received_job() -> Job:
    """Return the job from standard input, in a fresh interpreter."""
    job: Job = pickle.load(sys.stdin.buffer)  # noqa: S301 - from the parent, before any code of the user's has run
    return job


def become_child(job: Job) -> None:
    """Turn this process into the child process of the job: keep its output, and let the parent decide when it ends."""
    redirect_output(job.output_file)
    # A killed process leaves no files: the parent removes this folder.
    tempfile.tempdir = str(job.folder)
    # Ctrl-C reaches all foreground processes, but the parent decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if sys.platform != "win32" and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)


def run_job(job: Job, progress_descriptor: int) -> None:
    """Run the scenario in this process, and write its outcome."""
    # A script may change the current folder.
    started, here = time.perf_counter(), Path.cwd()
    _clear(job)
    if job.deadline is not None and job.loaded.scenario.python_files:
        dump_stack_before(job.deadline, job.stack_dump_file)
    progress = _Progress(progress_descriptor)
    kept: list[RecordedRun] = []
    outcome = _outcome(job, progress, here, kept)
    outcome = outcome.model_copy(update={"wall_time": max(0.0, time.perf_counter() - started)})
    _write(outcome, job)
    for run in kept:
        # From here on the verdict is safe, however long the recordings take.
        progress.say(JUDGED)
        from sim_action.recording.export import write_recordings

        notes = tuple(write_recordings(run, job.recordings))
        if notes:
            _write(outcome.model_copy(update={"notes": (*outcome.notes, *notes)}), job)


def _write(outcome: Outcome, job: Job) -> None:
    with whole_file(job.outcome_file) as file:
        file.write(outcome.model_dump_json().encode())


def _clear(job: Job) -> None:
    """Remove files of an earlier run in the same place."""
    for path in filter(None, (job.trace, job.replay, job.motion, *job.recordings)):
        with suppress(OSError):
            path.unlink(missing_ok=True)


def exit_child() -> NoReturn:
    """End the process at once: threads and exit handlers of user code must not delay a written verdict."""
    with suppress(OSError, ValueError):
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(0)


class _Progress:
    """Writes sim times to the parent's pipe, at most every 0.1 s."""

    def __init__(self, descriptor: int) -> None:
        self.descriptor = descriptor
        self._next = 0.0

    def __call__(self, sim_time: float) -> None:
        if time.perf_counter() < self._next:
            return
        self._next = time.perf_counter() + _PROGRESS_PERIOD_S
        self.say(f"{sim_time:.3f}".encode())

    def say(self, line: bytes) -> None:
        """Send a line to the parent."""
        try:
            os.write(self.descriptor, line + b"\n")
        except OSError:
            # The run goes on if the parent does not read.
            self._next = float("inf")


def _outcome(job: Job, progress: _Progress, here: Path, kept: list[RecordedRun]) -> Outcome:
    """Return the outcome; `here`: the folder that files are named from; `kept` receives the run to record."""
    scenario = job.loaded.scenario
    try:
        run = _stored_run(job, progress, kept)
    except InvalidScenario as error:
        return _invalid(job, error)
    except (RunError, ModelError) as error:
        if isinstance(error, RunError):
            error.location = _place_of(error, job.loaded, here)
        if isinstance(error.__context__, MemoryError):
            return _error(job, _OUT_OF_MEMORY, f"{error}; {out_of_memory(job)}", error)
        return _error(job, _KINDS.get(type(error), ("engine", "run error")), str(error), error)
    except MemoryError:
        return _error(job, _OUT_OF_MEMORY, out_of_memory(job))
    except Exception as error:  # noqa: BLE001 - an internal error is an outcome too
        return _failed(job, Failure.of_fault(InternalError.of(error)))
    return _judged(job, scenario, run)


def _stored_run(job: Job, progress: _Progress, kept: list[RecordedRun]) -> SimulationRun:
    """Return the run after its trace is stored. Raise the error of a run without a verdict."""
    # Reporting a lack of memory needs memory. This reserves addresses only: they cost nothing, while filling them with
    # zeros would take 20 ms.
    with _reserved():
        loaded = _checked(job.loaded)
        scene = build_scene(loaded)
        filmed, recorded, compared = job.replay is not None, bool(job.recordings), job.motion is not None
        footage = RunRecorder(loaded.scenario, filmed=filmed, recorded=recorded, compared=compared)
        try:
            run = _simulated(loaded, scene, footage, progress)
        except RunError:
            # The recorded part shows the problem.
            with suppress(OSError, MemoryError):
                store_artifacts(job, scene, footage)
            kept += to_record(job, scene, footage)
            raise
        notes = (*store_artifacts(job, scene, footage), *_store_motion(job, scene, footage))
        if loaded.workspace.updates_golden and (trace := footage.trace()) is not None:
            from sim_action.runner.golden_update import write_goldens

            notes += write_goldens(loaded, scene, trace)
        kept += to_record(job, scene, footage)
    return replace(run, notes=(*run.notes, *notes))


def _reserved() -> mmap.mmap:
    """Reserve memory that is freed when an error is reported. Raise MemoryError."""
    try:
        return mmap.mmap(-1, _RESERVE_BYTES)
    except OSError as error:
        raise MemoryError from error


def _invalid(job: Job, error: InvalidScenario) -> Outcome:
    """Return the outcome of a scenario that turned out to be invalid when it ran."""
    return Outcome.of_invalid(job.loaded.file, error).model_copy(update={"name": job.loaded.scenario.name})


def _checked(loaded: LoadedScenario) -> LoadedScenario:
    """Return the scenario with checks that need its model, if only this process may read it. Raise InvalidScenario."""
    if loaded.model is not None:
        return loaded
    # The text that was read earlier is judged, even if its file has changed.
    workspace = loaded.workspace
    permissions = Permissions(outside=workspace.allow_outside, updates_golden=workspace.updates_golden)
    again = checked(loaded.source, permissions, evaluate=True)
    return replace(loaded, model=again.model)


def _simulated(loaded: LoadedScenario, scene: Scene, footage: RunRecorder, progress: _Progress) -> SimulationRun:
    """Return the run, in the process that started it only. Raise RunError, ModelError, InvalidScenario."""
    born, own = os.getpid(), {1: "standard output", 2: "standard error", progress.descriptor: "progress"}
    try:
        run = simulate(loaded.scenario, scene, progress, footage)
    except BadStart as error:
        raise InvalidScenario(loaded.document.problem(*problem) for problem in error.problems) from None
    except BadSource as error:
        raise InvalidScenario([_of_source(loaded.document, error)]) from None
    finally:
        if os.getpid() != born:
            # A copy made by os.fork() in user code: only the original may write the verdict.
            os._exit(0)
    closed = [f"{number} ({what})" for number, what in own.items() if not _is_open(number)]
    if closed:
        raise ScriptError(
            f"the controller closed file descriptors of sim-action: {', '.join(closed)}; "
            "printed output is lost, or is in other files"
        )
    return run


def _of_source(document: Document, error: BadSource) -> Problem:
    return document.problem((*_path_of_source(document, error.index), error.key), str(error))


def _path_of_source(document: Document, index: int) -> KeyPath:
    """Return the keys of a command source; a single source may stand below `commands:` without a list."""
    listed = ("commands", index)
    return listed if listed in document.marks else ("commands",)


def _place_of(error: RunError, loaded: LoadedScenario, here: Path) -> Location | None:
    """Return the place in the user's file, or else in the scenario; files are named from the folder `here`."""
    if (place := error.location) is not None:
        file = Path(place.file)
        return replace(place, file=file_name(file.relative_to(here))) if file.is_relative_to(here) else place
    if error.keys is not None:
        return loaded.document.location(error.keys)
    if not isinstance(error, ScriptError) or error.source is None:
        return None
    key = next(key for key in COMMANDS if key in type(loaded.scenario.commands[error.source]).model_fields)
    return loaded.document.location((*_path_of_source(loaded.document, error.source), key))


def _is_open(descriptor: int) -> bool:
    try:
        os.fstat(descriptor)
    except OSError:
        return False
    return True


_OUT_OF_MEMORY: Final[tuple[FailureKind, str]] = ("memory", "out of memory")
_KINDS: Final[dict[type[Exception], tuple[FailureKind, str]]] = {
    EngineError: ("engine", "engine error"),
    SimulationUnstable: ("unstable", "simulation unstable"),
    MissedContact: ("missed contact", "missed contact"),
    ScriptError: ("script", "script error"),
    ModelError: ("invalid", "invalid model"),
    RefusedModel: ("invalid", "invalid model"),
}


def _error(job: Job, kind: tuple[FailureKind, str], message: str, error: Exception | None = None) -> Outcome:
    location, details = getattr(error, "location", None), getattr(error, "details", "")
    return _failed(job, Failure(kind=kind[0], title=kind[1], message=message, location=location, details=details))


def _failed(job: Job, failure: Failure) -> Outcome:
    return Outcome(name=job.loaded.scenario.name, file=job.loaded.file, status="error", failures=(failure,))


def _judged(job: Job, scenario: Scenario, run: SimulationRun) -> Outcome:
    expectations = tuple(
        ExpectationOutcome(
            name=expected.name,
            assertion=expected.assertion.key,
            severity=expected.severity,
            location=expected.location,
            verdict=verdict,
            unexercised=scenario.unexercised or "error",
            scope=Scope.of(expected),
        )
        for expected, verdict in zip(scenario.expect, run.verdicts, strict=True)
    )
    return Outcome(
        name=scenario.name,
        file=job.loaded.file,
        status=status_of(expectations),
        expectations=expectations,
        end=run.end,
        sim_time=run.sim_time,
        real_time_factor=run.sim_time / run.wall_time if run.wall_time > 0 else None,
        travelled=run.travelled,
        seed=scenario.seed,
        scenario_seed=job.loaded.source.scenario_seed,
        digest=run.digest,
        engine=run.engine,
        warnings=(*job.loaded.warnings, *(each.warning(job.loaded.document) for each in run.findings)),
        notes=run.notes,
        trace=job.trace_name,
        replay=job.named(job.replay) if job.replay and job.replay.is_file() else None,
    )
