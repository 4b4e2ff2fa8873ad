"""The outcome of a child process: the one that it wrote, if it can be trusted, or the reason why there is none.

The child process may have run untrusted code: its files are read as data, with limits. Names, places and paths that the
parent knows are not taken from it.
"""

from __future__ import annotations

import os
import re
import signal
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final, Literal

from pydantic import ValidationError

from sim_action.core import units
from sim_action.core.errors import Location, is_refusal
from sim_action.core.process import Interruption
from sim_action.core.provenance import Provenance, installed_version, provenance
from sim_action.core.records import replace
from sim_action.core.version import __version__
from sim_action.core.wording import MAX_MESSAGE_CHARS, escaped_line, shortened
from sim_action.core.workspace import PathError
from sim_action.core.yaml_document import Document
from sim_action.engines import ENGINES, chosen, named_version
from sim_action.results.masking import Mask
from sim_action.results.outcome import Failure, FailureKind, Outcome
from sim_action.runner.isolation.child_process import ChildProcess
from sim_action.runner.job import out_of_memory
from sim_action.runner.observed_inputs import inputs_in
from sim_action.runner.process_output import place_in_stack_dump, split_output
from sim_action.scenario.model import LoadedScenario

_MAX_DETAILS_CHARS: Final = 20_000
_MAX_LAST_WORDS_CHARS: Final = 2_000
_MAX_LAST_WORDS_LINES: Final = 20


Limit = Literal["wall limit", "output limit"]
TOO_SLOW: Final = "too slow"  # the title of a failure at the wall limit of a run whose sim time was still moving on
_MOVING_PART: Final = 0.2  # the last part of the wall limit, in which sim time must have moved on
Ending = int | Limit  # the exit status of a child process (see `ChildProcess.poll`), or the limit at which it was ended


def outcome_of(child: ChildProcess, ending: Ending) -> Outcome:
    """Return the outcome of a child process that has ended."""
    job = child.job
    mask = Mask.of(os.environ, job.loaded.workspace.pass_env)
    diagnostics, output = split_output(mask.text(child.report.output.decode("utf-8", errors="replace")))
    # It is written once everything is judged, so later events change no verdict.
    written = _written(child, mask)
    outcome = written or mask.outcome(without_verdict(job.loaded, _failure(child, ending, output)))
    own = unjudged(job.loaded)
    if job.replay is not None and job.loaded.scenario.runs_user_code and child.wrote(job.replay):
        mask.replay(job.replay)
    return outcome.model_copy(
        update={
            **{name: getattr(own, name) for name in own.model_fields_set - {"status", "failures"}},
            "statistics": None,
            "trace": job.trace_name if child.wrote(job.trace) else None,
            "replay": job.named(job.replay) if job.replay and child.wrote(job.replay) else None,
            "recordings": tuple(job.named(path) for path in job.recordings if child.wrote(path)),
            "notes": (*outcome.notes, *(_afterwards(child, ending) if written else ())),
            "engine": outcome.engine or _engine(job.loaded),
            "provenance": _provenance(job.loaded),
            "diagnostics": diagnostics,
            "output": output,
            "wall_time": time.monotonic() - child.started,
        }
    )


def refusal_of(child: ChildProcess, ending: Ending) -> OSError | None:
    """Return the error of the system if a child process ended before it could begin, even with a traceback."""
    if child.refusal is not None or child.begun or not isinstance(ending, int) or ending <= 0:
        return child.refusal
    *_, number = (0, *map(int, _SYSTEM_ERROR.findall(child.report.output)))
    error = OSError(number, os.strerror(number))
    return error if is_refusal(error) else None


_SYSTEM_ERROR: Final = re.compile(rb"^\w*Error: \[Errno (\d{1,5})\]", re.MULTILINE)


def inputs_of(child: ChildProcess) -> tuple[str, ...] | None:
    """Return the files that user code of a child process has read; None: it may have read anything."""
    if not child.job.loaded.scenario.runs_user_code:
        return ()
    return None if child.left else inputs_in(child.report.inputs)


def engine_provenance(backend: str) -> Provenance:
    """Return the provenance of runs on this machine with an engine; `backend`: as the scenario names it."""
    return provenance(ENGINES[chosen(backend)].distribution, __version__)


def _engine(loaded: LoadedScenario) -> str:
    """Return the name of the engine that runs a scenario, and its version if this can be read."""
    engine = chosen(loaded.scenario.backend)
    try:
        return named_version(engine)
    except (OSError, ImportError):
        return engine


def _provenance(loaded: LoadedScenario) -> Provenance | None:
    with suppress(OSError, ImportError):
        used = dict.fromkeys(source.package for source in loaded.scenario.commands if source.package)
        packages = tuple(f"{name} {installed_version(name) or ''}".rstrip() for name in used)
        return engine_provenance(loaded.scenario.backend).model_copy(update={"packages": packages})
    return None


def interrupted(loaded: LoadedScenario) -> Outcome:
    """Return the outcome of a scenario that an interruption stopped or prevented."""
    message = "the run was interrupted before this scenario ended"
    return _on_its_engine(loaded, Failure(kind="interrupted", title="interrupted", message=message))


def not_started(loaded: LoadedScenario, cause: str) -> Outcome:
    """Return the outcome of a scenario whose process the system refused to start."""
    message = f"the process of this scenario could not be started: {cause}"
    return _on_its_engine(loaded, Failure(kind="crash", title="not started", message=message))


def _on_its_engine(loaded: LoadedScenario, failure: Failure) -> Outcome:
    return without_verdict(loaded, failure).model_copy(update={"engine": _engine(loaded)})


def without_run(loaded: LoadedScenario, interruption: Interruption, *, is_needless: bool) -> Outcome:
    """Return the outcome of a run that did not start or was interrupted; `is_needless`: its gate was decided."""
    if is_needless:
        return skipped(loaded, "not run: its gate was decided before")
    return interrupted(loaded) if interruption.happened else skipped(loaded)


def skipped(loaded: LoadedScenario, note: str = "not run: another scenario did not pass (--fail-fast)") -> Outcome:
    """Return the outcome of a scenario that was not started; `note`: the reason."""
    return unjudged(loaded).model_copy(update={"status": "skipped", "notes": (note,)})


def without_verdict(loaded: LoadedScenario, failure: Failure) -> Outcome:
    """Return an error outcome."""
    return unjudged(loaded).model_copy(update={"failures": (failure,)})


def unjudged(loaded: LoadedScenario) -> Outcome:
    """Return the outcome of a run without verdict and reason."""
    return Outcome.of_source(loaded.source).model_copy(update={"name": loaded.scenario.name})


def _written(child: ChildProcess, mask: Mask) -> Outcome | None:
    try:
        outcome = Outcome.model_validate_json(child.report.verdict)
    except ValidationError:
        return None
    if not _is_consistent(outcome, child.job.loaded):
        return None
    return _of_limited_length(mask.outcome(outcome))


def _of_limited_length(outcome: Outcome) -> Outcome:
    """Return the outcome with its texts cut: user code may raise an exception with a text of many megabytes."""
    if not any(len(text) > MAX_MESSAGE_CHARS for text in _texts(outcome)):
        return outcome
    expectations = tuple(
        expected.model_copy(update={"verdict": expected.verdict.with_texts(_cut)}) for expected in outcome.expectations
    )
    failures = tuple(
        failure.model_copy(
            update={
                "message": _cut(failure.message),
                "details": shortened(failure.details, _MAX_DETAILS_CHARS),
                "location": failure.location and replace(failure.location, file=_cut(failure.location.file)),
            }
        )
        for failure in outcome.failures
    )
    notes = {"notes": tuple(map(_cut, outcome.notes)), "model_notes": tuple(map(_cut, outcome.model_notes))}
    marks = tuple(replace(mark, words=_cut(mark.words)) for mark in outcome.marks)
    return outcome.model_copy(update={"expectations": expectations, "failures": failures, "marks": marks, **notes})


def _texts(outcome: Outcome) -> Iterator[str]:
    """Yield the texts that user code may have written."""
    for expected in outcome.expectations:
        yield from expected.verdict.texts
    for failure in outcome.failures:
        yield from (failure.message, failure.details, failure.location.file if failure.location else "")
    yield from (*outcome.notes, *outcome.model_notes, *(mark.words for mark in outcome.marks))


def _cut(text: str) -> str:
    return shortened(text, MAX_MESSAGE_CHARS)


def _is_consistent(outcome: Outcome, loaded: LoadedScenario) -> bool:
    """Return True if every expectation was judged and the status fits the verdicts."""
    if outcome.status == "error":
        return bool(outcome.failures)
    asked = [(expected.name, expected.severity, expected.location) for expected in loaded.scenario.expect]
    judged = [(expected.name, expected.severity, expected.location) for expected in outcome.expectations]
    if judged != asked or outcome.failures or outcome.strict != loaded.strict:
        return False
    return outcome.status == outcome.judged_status(is_varied=loaded.source.group is not None)


def _afterwards(child: ChildProcess, ending: Ending) -> Iterator[str]:
    """Yield notes about a child process that left a verdict."""
    yield from _left_behind(child)
    if ending != 0:
        by = ending if isinstance(ending, str) else _signal_name(ending) or f"exit {ending}"
        what = "after the verdict, its process ended" if child.judged is None else "the recordings were cut off"
        yield f"{what}: {by}"


def _left_behind(child: ChildProcess) -> tuple[str, ...]:
    if not child.left:
        return ()
    which = "a process" if child.left == 1 else f"{child.left} processes"
    return (f"ended {which} that its script left behind",)


def _failure(child: ChildProcess, ending: Ending, output: str) -> Failure:
    is_stuck = ending == "wall limit" and not _is_moving(child)
    place = _stuck_at(child) if is_stuck else _exit_call(child, ending)
    kind, title, cause = _cause(child, ending, output, place)
    message = "; ".join((cause, f"its last report was at {child.sim_time:.2f} s of sim time", *_left_behind(child)))
    if place is None and ending == "wall limit":
        place = _limiting_key(child.job.loaded.document)
    return Failure(kind=kind, title=title, message=message, location=place, details=_last_words(output))


def _is_moving(child: ChildProcess) -> bool:
    begun = child.started if child.judged is None else child.judged
    limit = child.job.loaded.scenario.wall_seconds
    return child.moved is not None and child.moved > begun + (1 - _MOVING_PART) * limit


def _stuck_at(child: ChildProcess) -> Location | None:
    """Return the line of user code that was running when the time was up."""
    loaded = child.job.loaded
    files = [_script_file(loaded, name) for name in loaded.scenario.python_files]
    place = place_in_stack_dump(child.report.stack_dump.decode("utf-8", errors="replace"), files)
    return None if place is None else child.job.named_from_here(place)


def _script_file(loaded: LoadedScenario, name: str) -> Path:
    try:
        return loaded.workspace.file(name)
    except PathError:  # a script may have deleted itself
        return loaded.workspace.directory / name


def _exit_call(child: ChildProcess, ending: Ending) -> Location | None:
    """Return the line of user code that called `os._exit`, if that ended the process."""
    place = child.exit_call
    if place is None or isinstance(ending, str) or _signal_name(ending) is not None:
        return None
    return child.job.named_from_here(replace(place, file=escaped_line(place.file)))


def _limiting_key(document: Document) -> Location:
    stated = next((key for key in ("wall_limit", "time_limit") if (key,) in document.marks), "time_limit")
    return document.location((stated,))


def _last_words(output: str) -> str:
    return "\n".join(output[-_MAX_LAST_WORDS_CHARS:].split("\n")[-_MAX_LAST_WORDS_LINES:])


def _cause(child: ChildProcess, ending: Ending, output: str, place: Location | None) -> tuple[FailureKind, str, str]:
    """Return kind, title and message of an end without a verdict."""
    scenario = child.job.loaded.scenario
    if ending == "wall limit":
        limit = f"no verdict after {scenario.wall_seconds:g} s of wall time (wall_limit)"
        if _is_moving(child):
            advice = "raise wall_limit, or run fewer scenarios at the same time (--jobs)"
            return "wall limit", TOO_SLOW, f"{limit}, and sim time was still moving on: {advice}"
        return "wall limit", "wall limit", f"{limit}: {' or '.join((*_stuck(child, place), 'a limit that is too low'))}"
    if ending == "output limit":
        printed = f"more than {units.display(scenario.output_bytes, 'B')} were printed"
        return "crash", "output limit", f"{printed} (output_limit): does a controller print at every step?"
    if (by := _signal_name(ending)) is None:
        message = f"the process of this scenario ended by itself, with exit code {ending} and no verdict"
        called = "" if place is None else f"{place} called os._exit({ending}): "
        return "crash", f"exit {ending}", f"{called}{message}"
    return _cause_of_signal(child, by, output)


def _stuck(child: ChildProcess, place: Location | None) -> Iterator[str]:
    """Yield possible reasons why a scenario does not end; `place`: the line that was running, if known."""
    scenario = child.job.loaded.scenario
    if place is not None:
        yield f"{place} did not return"
        return
    if scenario.robot.is_xacro and not child.sim_time:
        yield "xacro that does not terminate"
    if any(source.runs_user_code for source in scenario.commands):
        yield "a stuck controller"
    if any(assertion.runs_user_code for assertion in scenario.assertions):
        yield "a stuck assertion"
    if any(mounted.sensor.runs_user_code for mounted in scenario.sensors):
        yield "a stuck sensor"


def _cause_of_signal(child: ChildProcess, title: str, output: str) -> tuple[FailureKind, str, str]:
    scenario = child.job.loaded.scenario
    by = f"the process of this scenario was ended by {title}"
    is_full = child.peak_memory + _UNTOUCHED_BYTES >= scenario.memory_bytes
    if title in _CRASHES and (is_full or _BAD_ALLOC in output):
        taken = f", when it had taken {child.peak_memory / 2**30:.2g} GiB" if child.peak_memory else ""
        return "memory", "out of memory", f"{out_of_memory(child.job)}; {by}{taken}"
    return "crash", title, f"{by}{_MEANINGS.get(title, '')}"


_BAD_ALLOC: Final = "std::bad_alloc"
_CRASHES: Final = ("SIGSEGV", "SIGBUS", "SIGABRT")  # signals that end native code which does not check its allocations
_UNTOUCHED_BYTES: Final = 256 << 20  # the limit is on address space; libraries reserve this much and use little of it
_NATIVE: Final = ": native code crashed, in the engine or in a library of the script"
_MEANINGS: Final[Mapping[str, str]] = {
    "SIGSEGV": _NATIVE,
    "SIGBUS": _NATIVE,
    "SIGILL": _NATIVE,
    "SIGFPE": _NATIVE,
    "SIGABRT": ": native code aborted, in the engine or in a library of the script",
    "SIGKILL": ": it killed itself, or the machine ran out of memory",
    "STATUS_ACCESS_VIOLATION": _NATIVE,
    "STATUS_STACK_OVERFLOW": _NATIVE,
}
# Windows has no signals: a crash gives one of these exit codes (NTSTATUS values of [MS-ERREF]).
_STATUSES: Final[Mapping[int, str]] = {0xC0000005: "STATUS_ACCESS_VIOLATION", 0xC00000FD: "STATUS_STACK_OVERFLOW"}


def _signal_name(ending: int) -> str | None:
    """Return the name of the signal or status that ended a child process; None if it exited by itself."""
    if ending >= 0:
        return _STATUSES.get(ending)
    try:
        return signal.Signals(-ending).name
    except ValueError:
        return f"signal {-ending}"
