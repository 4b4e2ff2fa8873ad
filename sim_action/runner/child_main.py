"""The code that runs inside the child process of one scenario: simulate, write the outcome as data, exit."""

from __future__ import annotations

import errno
import mmap
import os
import pickle
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Final, NoReturn

from pydantic import JsonValue
from pydantic_core import PydanticSerializationError, to_json

from sim_action.core import errors
from sim_action.core.permissions import Permissions
from sim_action.core.records import dataclass, field, replace
from sim_action.core.wording import escaped_line, system_reason
from sim_action.core.yaml_document import Document, KeyPath
from sim_action.engines import ENGINES
from sim_action.recording.export import write_recordings
from sim_action.results.outcome import ExpectationOutcome, Failure, FailureKind, Outcome, Scope, flattened, status_of
from sim_action.runner.job import BEGUN, JUDGED, ChildFiles, Job, OutcomeWriter, out_of_memory
from sim_action.runner.observed_inputs import ObservedInputs, hear_early, observed_inputs
from sim_action.runner.process_output import dump_stack_before, is_open, redirect_output
from sim_action.scenario.loading import build_scene, checked
from sim_action.scenario.model import LoadedScenario, Scenario
from sim_action.scenario.mutation import UNTOUCHED, Mutation, Seams
from sim_action.simulation.loop import SimulationRun, simulate
from sim_action.simulation.recorder import RunRecorder
from sim_action.state.timeline import TimeMark
from sim_action.state.trace import motion_figures
from sim_action.state.trace_storage import save_trace
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.recording.export.recorded_run import RecordedRun

_PROGRESS_PERIOD_S: Final = 0.1
_RESERVE_BYTES: Final = 32 << 20  # bytes of address space; nothing is written there


def become_child(files: ChildFiles, progress_descriptor: int) -> None:
    """Turn this process into a child process: keep its output, and let the parent decide when it ends."""
    redirect_output(files.output)
    for descriptor in (*files.descriptors, progress_descriptor):
        # Programs that user code starts have no use for them.
        os.set_inheritable(descriptor, False)
    # A killed process leaves no files: the parent removes this folder.
    tempfile.tempdir = str(files.scratch)
    # Ctrl-C and Ctrl-\ reach all foreground processes, but the parent decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform != "win32":
        signal.signal(signal.SIGQUIT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if sys.platform != "win32" and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)


def run_job(job: Job, files: ChildFiles, progress_descriptor: int, *, is_first: bool = True) -> bool:
    """Run the scenario here, and write its outcome. Return True if it ended normally, for others to follow."""
    started = time.perf_counter()
    writer = OutcomeWriter(files.outcome)
    progress = _Progress(progress_descriptor, job.loaded.scenario)
    if is_first:
        progress.say(BEGUN)
    remove_earlier(job)
    if job.deadline is not None and job.loaded.scenario.python_files:
        dump_stack_before(job.deadline, files.stack_dump)
    inputs = observed_inputs(job, files.scratch)
    kept = _Kept()
    outcome = _outcome(job, progress, kept)
    wall_time = max(0.0, time.perf_counter() - started)
    kept_too = {"notes": (*outcome.notes, *kept.notes), "marks": kept.marks}
    outcome = outcome.model_copy(update={**kept_too, "wall_time": wall_time})
    written = encoded(outcome, inputs)
    try:
        writer.write(written)
    except ValueError as error:
        outcome = _failed(job, Failure(kind="crash", title="outcome too large", message=str(error)))
        writer.write(encoded(outcome))
    is_normal = not kept.notes and all(failure.kind in _SIMULATED for failure in outcome.failures)
    for run in kept.runs:
        # From here on the verdict is safe, however long the recordings take.
        progress.say(JUDGED)
        if notes := tuple(write_recordings(run, job.recordings)):
            is_normal = False
            with suppress(OSError, ValueError):
                writer.write(encoded(outcome.model_copy(update={"notes": (*outcome.notes, *notes)}), inputs))
    return is_normal


_SIMULATED: Final[frozenset[FailureKind]] = frozenset({"unstable", "missed contact", "invalid"})
"""The errors that a run always has, wherever it runs."""


def encoded(outcome: Outcome, inputs: ObservedInputs | None = None) -> bytes:
    """Return an outcome as JSON, with lone surrogates escaped, and in a second line the inputs of user code."""
    try:
        written = outcome.model_dump_json().encode()
    except PydanticSerializationError:
        written = to_json(_without_surrogates(outcome.model_dump()), inf_nan_mode="null")
    return written if inputs is None else written + b"\n" + inputs.encoded()


def _without_surrogates(value: object) -> object:
    match value:
        case str():
            return value.encode("utf-8", "backslashreplace").decode()
        case dict():
            return {key: _without_surrogates(nested) for key, nested in value.items()}
        case list() | tuple():
            return tuple(map(_without_surrogates, value))
    return value


@dataclass(slots=True)
class _Kept:
    """The remains of a run besides its verdict."""

    notes: list[str] = field(default_factory=list)  # remarks about evidence that was not written
    marks: tuple[TimeMark, ...] = ()  # the timeline of the run
    runs: list[RecordedRun] = field(default_factory=list)  # the run, if it is recorded


def exit_child() -> NoReturn:
    """End the process at once: threads and exit handlers of user code must not delay a written verdict."""
    # User code may have replaced the streams by anything.
    for stream in (sys.stdout, sys.stderr):
        with suppress(Exception):
            stream.flush()
    os._exit(0)


class _Progress:
    """Writes sim times to the parent's pipe, at most every 0.1 s; a short run without user code writes none."""

    def __init__(self, descriptor: int, scenario: Scenario) -> None:
        self.descriptor = descriptor
        self._next = 0.0 if scenario.runs_user_code else time.perf_counter() + _PROGRESS_PERIOD_S

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


def _outcome(job: Job, progress: _Progress, kept: _Kept) -> Outcome:
    """Return the outcome; `kept` receives the rest."""
    shared: SharedModules | None = None
    if job.loaded.scenario.python_files:
        from sim_action.core.user_scripts import SharedModules  # a usual run does without it

        shared = SharedModules(row.package for row in ENGINES.values())
    try:
        return _judged(job, job.loaded.scenario, _stored_run(job, progress, kept))
    except errors.InvalidScenario as error:
        return Outcome.of_invalid(job.loaded.file, error).model_copy(update={"name": job.loaded.scenario.name})
    except (errors.RunError, errors.ModelError) as error:
        return _of_run_error(job, error)
    except MemoryError:
        return _error(job, _OUT_OF_MEMORY, out_of_memory(job))
    except Exception as error:  # noqa: BLE001 - an internal error is an outcome too
        if isinstance(error, OSError) and error.errno in _REFUSALS:
            return _refused_by_system(job, error)
        fault = None if shared is None else shared.fault(error)
        return _of_fault(job, errors.InternalError.of(error)) if fault is None else _of_run_error(job, fault)


def _of_fault(job: Job, fault: errors.InternalError) -> Outcome:
    failure, document = Failure.of_fault(fault), job.loaded.document
    if isinstance(fault, errors.PackageFault):
        failure = failure.model_copy(update={"location": document.location(document.path_of_key(fault.part))})
    return _failed(job, failure)


def _of_run_error(job: Job, error: errors.RunError | errors.ModelError) -> Outcome:
    if isinstance(error, errors.RunError):
        error.location = _place_of(error, job)
    if isinstance(error.__context__, MemoryError):
        return _error(job, _OUT_OF_MEMORY, f"{error}; {out_of_memory(job)}", error)
    kind, title = _KINDS.get(type(error), ("engine", "run error"))
    key = _source_of(error, job)
    return _error(job, (kind, title if key is None or key in _OF_USERS else f"{key} error"), str(error), error)


def _stored_run(job: Job, progress: _Progress, kept: _Kept) -> SimulationRun:
    """Return the run after its trace is stored. Raise the error of a run without a verdict, OSError."""
    # Reporting a lack of memory needs memory. This reserves addresses only: they cost nothing, while filling them with
    # zeros would take 20 ms.
    with _reserved():
        loaded = _checked(job.loaded)
        scene = build_scene(loaded)
        filmed, recorded, compared = job.replay is not None, bool(job.recordings), job.motion is not None
        footage = RunRecorder(loaded.scenario, filmed=filmed, recorded=recorded, compared=compared)
        try:
            run = _simulated(loaded, scene, footage, progress)
        except Exception as error:
            if not isinstance(error, errors.RunError) and not isinstance(
                errors.InternalError.of(error), errors.PackageFault
            ):
                raise
            # The recorded part shows the problem.
            job, scene = _as_it_happened(job, scene, footage)
            kept.marks = footage.marks
            kept.notes += store_evidence(job, scene, footage)
            kept.runs += run_to_record(job, scene, footage)
            raise
        job, scene = _as_it_happened(job, scene, footage)
        kept.marks = footage.marks
        kept.notes += store_evidence(job, scene, footage)
        if loaded.workspace.updates_golden and (trace := footage.trace()) is not None:
            from sim_action.runner.golden_update import updated_goldens  # a usual run does without it

            verdicts, notes = updated_goldens(loaded, scene, trace, run.verdicts)
            run = replace(run, verdicts=verdicts)
            kept.notes += notes
        kept.runs += run_to_record(job, scene, footage)
    return run


def _as_it_happened(job: Job, scene: Scene, footage: RunRecorder) -> tuple[Job, Scene]:
    """Return a job and its scene with the times of the events of the run, and without what never came."""
    if not footage.scenario.events:
        return job, scene
    from sim_action.scenario.events import without_absent  # few scenarios have events

    scenario = without_absent(footage.scenario)
    return replace(job, loaded=replace(job.loaded, scenario=scenario)), replace(scene, world=scenario.world)


def _reserved() -> mmap.mmap:
    """Reserve memory that is freed when an error is reported. Raise MemoryError."""
    try:
        return mmap.mmap(-1, _RESERVE_BYTES)
    except OSError as error:
        raise MemoryError from error


def _checked(loaded: LoadedScenario) -> LoadedScenario:
    """Return the scenario with checks that need its model, if only this process may read it. Raise InvalidScenario."""
    if loaded.model is not None:
        return loaded
    # The text that was read earlier is judged, even if its file has changed.
    workspace = loaded.workspace
    permissions = Permissions(outside=workspace.allow_outside, updates_golden=workspace.updates_golden)
    again = checked(loaded.source, permissions, evaluate=True)
    return replace(loaded, model=again.model, actor_models=again.actor_models)


def _seams(mutation: Mutation | None, scene: Scene) -> Seams:
    if mutation is None:
        return UNTOUCHED
    # Only `sim-action prove` needs it.
    from sim_action.simulation.mutations import MutantSeams

    return MutantSeams(mutation, scene)


def _simulated(loaded: LoadedScenario, scene: Scene, footage: RunRecorder, progress: _Progress) -> SimulationRun:
    """Return the run, in the process that started it only. Raise RunError, ModelError, InvalidScenario."""
    born = os.getpid()
    own = {1: "standard output", 2: "standard error", progress.descriptor: "progress"}
    guard = guarded(progress.say) if loaded.scenario.runs_user_code else nullcontext()
    try:
        with guard:
            run = simulate(loaded.scenario, scene, progress, footage, _seams(loaded.mutation, scene))
    except errors.BadStart as error:
        problems = [loaded.document.problem(*problem) for problem in error.by_keys]
        raise errors.InvalidScenario([*problems, *error.elsewhere]) from None
    except errors.BadSource as error:
        raise errors.InvalidScenario([_of_source(loaded.document, error)]) from None
    finally:
        if os.getpid() != born:
            # A copy made by os.fork() in user code: only the original may write the verdict.
            os._exit(0)
    closed = [f"{number} ({what})" for number, what in own.items() if not is_open(number)]
    if closed:
        raise errors.ScriptError(
            f"the controller closed file descriptors of sim-action: {', '.join(closed)}; "
            "printed output is lost, or is in other files"
        )
    return run


def _of_source(document: Document, error: errors.BadSource) -> errors.Problem:
    return document.problem((*_path_of_source(document, error.index, error.actor), error.key), str(error))


def _path_of_source(document: Document, index: int, actor: int | None) -> KeyPath:
    above: KeyPath = () if actor is None else ("world", "actors", actor)
    listed = (*above, "commands", index)
    return listed if listed in document.marks else (*above, "commands")


def _place_of(error: errors.RunError, job: Job) -> errors.Location | None:
    """Return the place in the user's file, or else in the scenario."""
    loaded = job.loaded
    if (place := error.location) is not None:
        return job.named_from_here(place)
    if error.keys is not None:
        return loaded.document.location(error.keys)
    key = _source_of(error, job)
    if not isinstance(error, errors.ScriptError) or error.source is None or key is None:
        return None
    return loaded.document.location((*_path_of_source(loaded.document, error.source, error.actor), key))


_OF_USERS: Final = frozenset({"script", "process", "ros1", "ros2"})
"""The command sources that run code of the user, whose errors are all called "script error"."""


def _source_of(error: Exception, job: Job) -> str | None:
    """Return the key of the command source that failed, such as "pose"; None if no source did."""
    if not isinstance(error, errors.ScriptError) or error.source is None:
        return None
    scenario = job.loaded.scenario
    commands = scenario.commands if error.actor is None else scenario.world.actors[error.actor].commands
    return commands[error.source].key


_REFUSALS: Final = frozenset(
    getattr(errno, name)
    for name in ("EMFILE", "ENFILE", "ENOSPC", "EDQUOT", "EFBIG", "EROFS", "EIO", "EAGAIN", "EACCES", "EPERM")
    if hasattr(errno, name)
)
"""The errors by which the system refuses a file or a process, regardless of the request."""

_OUT_OF_MEMORY: Final[tuple[FailureKind, str]] = ("memory", "out of memory")
_KINDS: Final[dict[type[Exception], tuple[FailureKind, str]]] = {
    errors.EngineError: ("engine", "engine error"),
    errors.SimulationUnstable: ("unstable", "simulation unstable"),
    errors.MissedContact: ("missed contact", "missed contact"),
    errors.ScriptError: ("script", "script error"),
    errors.ModelError: ("invalid", "invalid model"),
    errors.RefusedModel: ("invalid", "invalid model"),
}


def _error(job: Job, kind: tuple[FailureKind, str], message: str, error: Exception | None = None) -> Outcome:
    location, details = getattr(error, "location", None), getattr(error, "details", "")
    return _failed(job, Failure(kind=kind[0], title=kind[1], message=message, location=location, details=details))


def _refused_by_system(job: Job, error: OSError) -> Outcome:
    """Return the outcome after the system refused a file or a process outside of user code."""
    what = ": ".join(filter(None, (escaped_line(str(error.filename or "")), system_reason(error))))
    if error.errno == errno.EMFILE and job.loaded.scenario.runs_user_code:
        hint = "does user code leave files open?"
        return _error(job, ("script", "script error"), f"no file descriptors were left ({what}): {hint}")
    return _error(job, ("crash", "system error"), what)


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
            scope=Scope.of(expected, scenario),
        )
        for expected, verdict in zip(scenario.expect, run.verdicts, strict=True)
    )
    is_varied = job.loaded.source.group is not None
    outcome = Outcome(
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
        surroundings=_surroundings(scenario, is_varied=is_varied),
        digest=run.digest,
        motion=motion_figures(run.trace) if is_varied else (),
        engine=run.engine,
        warnings=(*job.loaded.warnings, *(finding.warning(job.loaded.document) for finding in run.findings)),
        strict=job.loaded.strict,
        notes=run.notes,
        model_notes=run.model_notes,
        events=dict(run.events),
        actors={actor.name: actor.model for actor in scenario.world.actors},
    )
    return outcome.model_copy(update={"status": outcome.judged_status(is_varied=is_varied)})


_MAX_SURROUNDINGS: Final = 500  # the number of keys of a world from which on a run records none


def _surroundings(scenario: Scenario, *, is_varied: bool) -> dict[str, JsonValue]:
    allowed: dict[str, JsonValue] = {f"allow.{rule}": True for rule in scenario.allow}
    if is_varied:
        return allowed
    world = scenario.world.model_dump(mode="json", exclude_defaults=True)
    world |= {"objects": {body.get("name", str(place)): body for place, body in enumerate(world.pop("objects", ()))}}
    stated = dict(flattened({"world": world}))
    return allowed | (stated if len(stated) <= _MAX_SURROUNDINGS else {})


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
            save_trace(trace, job.trace, footage.marks)
    with _noted("replay", notes):
        if job.replay is not None and (film := footage.film()) is not None and footage.start is not None:
            from sim_action.recording.replay.build import make_replay  # many runs have no replay

            make_replay(
                *(job.loaded.scenario, scene, footage.start, film, job.replay),
                commanded=footage.commanded(),
                readings=footage.readings,
                events=footage.marks,
            )
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
        reason = system_reason(error) if is_expected else str(errors.InternalError.of(error))
        notes.append(f"{name}: {escaped_line(reason)}{effect and '; '}{effect}")


def run_to_record(job: Job, scene: Scene, footage: RunRecorder) -> Iterator[RecordedRun]:
    """Yield the run for recordings, if they are asked for, it has data, and it fits into memory."""
    if not job.recordings:
        return
    from sim_action.recording.export.recorded_run import RecordedRun  # a usual run does without it

    with suppress(MemoryError):
        trace = footage.trace()
        film = footage.film()
        if trace is not None and film is not None:
            run = RecordedRun.of(scene, film, trace, job.loaded.scenario, footage.twists())
            yield replace(run, wrenches=footage.wrenches(), actors=footage.actors)


_SPARE_DESCRIPTORS: Final = 64
_SPARE_SHARE: Final = 4  # of a low limit, at most one part in so many
_OURS: Final = str(Path(__file__).parent.parent / "_").removesuffix("_")


@contextmanager
def guarded(say: Callable[[bytes], None]) -> Iterator[None]:
    """Guard this process against user code that runs in this context; `say` sends a line to the parent."""
    with _spare_descriptors(), _noted_exits(say):
        yield


@contextmanager
def _spare_descriptors() -> Iterator[None]:
    """Lower the limit of open files in this context: after a leak, files can still be written and modules imported."""
    if sys.platform == "win32":
        yield
        return
    import resource

    limit, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if limit == resource.RLIM_INFINITY:
        yield
        return
    spare = min(_SPARE_DESCRIPTORS, limit // _SPARE_SHARE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (limit - spare, hard))
    try:
        yield
    finally:
        # User code may have changed it, too.
        now, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        restored = now if now == resource.RLIM_INFINITY else now + spare
        resource.setrlimit(
            resource.RLIMIT_NOFILE, (restored if hard == resource.RLIM_INFINITY else min(restored, hard), hard)
        )


@contextmanager
def _noted_exits(say: Callable[[bytes], None]) -> Iterator[None]:
    """Send the line of user code that calls `os._exit` in this context, in this process."""
    leave, born = os._exit, os.getpid()

    def noted_exit(status: int) -> NoReturn:
        if os.getpid() == born:
            _say_caller(sys._getframe(1), say)  # noqa: SLF001 - as `inspect` does
        leave(status)

    setattr(os, "_exit", noted_exit)  # noqa: B010 - for mypy, it is constant
    try:
        yield
    finally:
        setattr(os, "_exit", leave)  # noqa: B010


def _say_caller(frame: FrameType, say: Callable[[bytes], None]) -> None:
    file = os.fsencode(frame.f_code.co_filename)
    if not file.startswith(os.fsencode(_OURS)) and b"\n" not in file:
        say(b"exit %d %s" % (frame.f_lineno, file))


def received_job() -> tuple[Job, ChildFiles]:
    """Return the job and its files from standard input, with the parts of packages imported; or end the process."""
    hear_early()
    try:
        received: tuple[Job, ChildFiles] = pickle.load(sys.stdin.buffer)  # noqa: S301 - from the parent
    except Exception as error:
        fault = errors.InternalError.of(error)
        if not isinstance(fault, errors.PackageFault):
            raise
        # The last words of this process are in the outcome.
        sys.stderr.write(f"{fault}\n")
        sys.stderr.flush()
        os._exit(1)
    return received
