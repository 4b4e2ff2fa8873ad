"""What happens inside the child process of one scenario: simulate, write the outcome as data, exit."""

from __future__ import annotations

import ctypes
import os
import pickle
import resource
import signal
import sys
import time
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sim_action.errors import EngineError, ModelError, RunError, ScriptError, SimulationUnstable
from sim_action.loading import build_scene
from sim_action.native_output import redirect_output
from sim_action.outcome import ExpectationOutcome, Failure, FailureKind, Outcome
from sim_action.scenario import LoadedScenario, Scenario
from sim_action.simulation import SimulationRun, simulate

MEMORY_LIMIT: Final = 4 << 30
"""Bytes of address space that one scenario may take."""

_PROGRESS_PERIOD: Final = 0.1
_PR_SET_PDEATHSIG: Final = 1  # of Linux's sys/prctl.h


@dataclass(frozen=True, slots=True)
class Job:
    """One scenario to run, and where its traces and its words go.

    Attributes:
        trace: where the trace is written.
        results: the folder that outcomes name the trace from.
        folder: the child's own, for `outcome.json` and `output.txt`.
    """

    loaded: LoadedScenario
    trace: Path
    results: Path
    folder: Path

    @property
    def outcome_file(self) -> Path:
        """Where the child writes its outcome."""
        return self.folder / "outcome.json"

    @property
    def output_file(self) -> Path:
        """Where everything goes that the child prints."""
        return self.folder / "output.txt"


def run_job(job: Job, progress_descriptor: int) -> None:
    """Runs a scenario in this process, which is the scenario's own, and writes the outcome."""
    redirect_output(job.output_file)
    _limit_resources()
    started = time.perf_counter()
    outcome = _outcome(job, _Progress(progress_descriptor))
    outcome = outcome.model_copy(update={"wall_time": time.perf_counter() - started})
    job.outcome_file.write_text(outcome.model_dump_json(), encoding="utf-8")


def main() -> None:
    """The entry of a fresh interpreter: the job comes on standard input, the descriptor as the argument."""
    job = pickle.load(sys.stdin.buffer)  # noqa: S301 - from the parent, before any code of the user's has run
    run_job(job, int(sys.argv[1]))
    sys.stdout.flush()
    sys.stderr.flush()
    # Threads and exit handlers that the user's code has left must not hold up a verdict that is written.
    os._exit(0)


def _limit_resources() -> None:
    # A parent that is killed outright cannot end its children.
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, MEMORY_LIMIT))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    # Ctrl-C goes to the whole foreground; the parent decides what to end.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


class _Progress:
    """Writes sim times to the parent's pipe, now and then."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        os.set_blocking(descriptor, False)
        self._next = 0.0

    def __call__(self, sim_time: float) -> None:
        if time.perf_counter() < self._next:
            return
        self._next = time.perf_counter() + _PROGRESS_PERIOD
        try:
            os.write(self._descriptor, f"{sim_time:.3f}\n".encode())
        except OSError:
            # A parent that does not listen is no reason to stop.
            self._next = float("inf")


def _outcome(job: Job, progress: _Progress) -> Outcome:
    scenario = job.loaded.scenario
    try:
        run = simulate(scenario, build_scene(job.loaded), progress)
        job.trace.parent.mkdir(parents=True, exist_ok=True)
        run.trace.save(job.trace)
    except (RunError, ModelError) as error:
        return _error(job, _KINDS.get(type(error), ("engine", "run error")), str(error), error)
    except MemoryError:
        message = f"needs more than the {MEMORY_LIMIT >> 30} GiB of memory that a scenario may take"
        return _error(job, ("memory", "out of memory"), message)
    except Exception as error:  # noqa: BLE001 - a fault of ours is an outcome too
        message = f"a fault of sim-action: {type(error).__name__}: {error}; please report it"
        return _error(job, ("internal", "internal error"), message, details=traceback.format_exc())
    return _judged(job, scenario, run)


_KINDS: Final[dict[type[Exception], tuple[FailureKind, str]]] = {
    EngineError: ("engine", "engine error"),
    SimulationUnstable: ("unstable", "simulation unstable"),
    ScriptError: ("script", "script error"),
    ModelError: ("invalid", "invalid model"),
}


def _error(
    job: Job, kind: tuple[FailureKind, str], message: str, error: Exception | None = None, details: str = ""
) -> Outcome:
    location = getattr(error, "location", None)
    failure = Failure(kind=kind[0], title=kind[1], message=message, location=location, details=details)
    return Outcome(name=job.loaded.scenario.name, file=job.loaded.file, status="error", failures=(failure,))


def _judged(job: Job, scenario: Scenario, run: SimulationRun) -> Outcome:
    expectations = tuple(
        ExpectationOutcome(
            name=expected.name,
            assertion=expected.assertion.key,
            severity=expected.severity,
            location=expected.location,
            verdict=verdict,
        )
        for expected, verdict in zip(scenario.expect, run.verdicts, strict=True)
    )
    return Outcome(
        name=scenario.name,
        file=job.loaded.file,
        status="failed" if any(expectation.failed for expectation in expectations) else "passed",
        expectations=expectations,
        end=run.end,
        sim_time=run.sim_time,
        real_time_factor=run.sim_time / run.wall_time,
        travelled=run.travelled,
        digest=run.digest,
        engine=run.engine,
        notes=run.notes,
        trace=os.path.relpath(job.trace, job.results),
    )


if __name__ == "__main__":
    main()
