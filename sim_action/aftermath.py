"""What became of a child: the outcome that it wrote, as far as it can be believed, or why there is none.

A child may have run a stranger's code: its files are read as data, with bounds, and only if they are files; what the
parent knows better (names, places, where the trace is) is not taken from it.
"""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from sim_action.isolation import Child
from sim_action.native_output import split_output
from sim_action.outcome import Failure, FailureKind, Outcome
from sim_action.regular_files import open_regular
from sim_action.scenario import LoadedScenario, Scenario
from sim_action.worker import Job

_MOST_OUTPUT: Final = 64_000
_MOST_LAST_WORDS: Final = 2_000
_MOST_OUTCOME: Final = 50_000_000


def outcome_of(child: Child, status: int | None) -> Outcome:
    """The outcome of a child that has ended with an exit status, or, with None, was ended at its wall limit."""
    job = child.job
    diagnostics, output = split_output(_end_of(job.output_file, _MOST_OUTPUT).decode("utf-8", errors="replace"))
    outcome = _written(job) if status == 0 else None
    if outcome is None:
        outcome = without_verdict(job.loaded, _failure(child, status, output))
    return outcome.model_copy(
        update={
            "name": job.loaded.scenario.name,
            "file": job.loaded.file,
            "trace": os.path.relpath(job.trace, job.results) if _is_regular(job.trace) else None,
            "diagnostics": diagnostics,
            "output": output,
            "wall_time": time.monotonic() - child.started,
        }
    )


def interrupted(loaded: LoadedScenario) -> Outcome:
    """The outcome of a scenario that the call did not come to, or not to the end of."""
    message = "the run was interrupted before this scenario was over"
    return without_verdict(loaded, Failure(kind="interrupted", title="interrupted", message=message))


def without_verdict(loaded: LoadedScenario, failure: Failure) -> Outcome:
    """An error outcome."""
    return Outcome(name=loaded.scenario.name, file=loaded.file, status="error", failures=(failure,))


def _written(job: Job) -> Outcome | None:
    try:
        outcome = Outcome.model_validate_json(_end_of(job.outcome_file, _MOST_OUTCOME))
    except ValidationError:
        return None
    return outcome if _is_consistent(outcome, job.loaded.scenario) else None


def _is_consistent(outcome: Outcome, scenario: Scenario) -> bool:
    """Whether every expectation was judged, and the status is what the verdicts make of it."""
    if outcome.status == "error":
        return bool(outcome.failures)
    asked = [(expected.name, expected.severity, expected.location) for expected in scenario.expect]
    judged = [(expected.name, expected.severity, expected.location) for expected in outcome.expectations]
    failed = any(expected.failed for expected in outcome.expectations)
    return judged == asked and not outcome.failures and outcome.status == ("failed" if failed else "passed")


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


def _is_regular(path: Path) -> bool:
    return path.is_file() and not path.is_symlink()


def _end_of(path: Path, most: int) -> bytes:
    """The last bytes of a file; nothing, if it is something else."""
    try:
        file = open_regular(path, follow_link=False)
    except OSError:
        return b""
    with file:
        file.seek(max(0, os.fstat(file.fileno()).st_size - most))
        return file.read(most)
