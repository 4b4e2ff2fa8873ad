"""`sim-action run`, from files to reports: load -> execute -> report."""

from __future__ import annotations

import platform
import time
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from sim_action import __version__
from sim_action.agreement import compared
from sim_action.discovery import file_name
from sim_action.engine_choice import runs_of
from sim_action.errors import ExitCode, InvalidScenario
from sim_action.execution import execute
from sim_action.interruption import Interruption
from sim_action.loading import load_all
from sim_action.outcome import Outcome, Results
from sim_action.permissions import Permissions
from sim_action.reporting import ReportRequest, report_options, write_reports
from sim_action.reports.progress import ProgressListener
from sim_action.scenario import LoadedScenario
from sim_action.sharding import Shard


@dataclass(frozen=True, slots=True)
class RunRequest:
    """What the command line asks for; `empty`: what was named but holds no scenario; from `shard` on: as typed."""

    files: list[Path]
    empty: list[str]
    reports: ReportRequest
    permissions: Permissions
    jobs: int
    shard: str | None
    backend: str | None
    seed: int | None


def run(request: RunRequest, interruption: Interruption) -> ExitCode:
    """Runs everything, writes every report, and returns what the process says to its caller."""
    started = time.monotonic()
    # If there is no scenario at all, the exit code says so.
    empty = request.empty if request.files else []
    shard = Shard.parse(request.shard, len(request.files) + len(empty)) if request.shard is not None else None
    options = report_options(request.reports)
    outcomes = _outcomes(request, shard.dealt(request.files) if shard else request.files, options.folder, interruption)
    if shard is None or shard.index == 1:
        outcomes += map(Outcome.of_nothing, empty)
    results = Results(
        sim_action=__version__,
        python=platform.python_version(),
        platform=platform.platform(),
        wall_time=time.monotonic() - started,
        shard=shard,
        outcomes=tuple(outcomes),
    )
    write_reports(results, options)
    return results.exit_code


def _outcomes(request: RunRequest, files: list[Path], folder: Path, interruption: Interruption) -> list[Outcome]:
    """Of each file, in their order; several of one that runs on several engines."""
    valid, invalid = load_all(files, request.permissions)
    runs: dict[Path, tuple[LoadedScenario, ...]] = {}
    for path, loaded in valid.items():
        try:
            runs[path] = runs_of(_seeded(loaded, request.seed), request.backend)
        except InvalidScenario as error:
            invalid[path] = error
    every = [run for several in runs.values() for run in several]
    listener = ProgressListener(total=len(every), verbosity=request.reports.verbosity)
    ran = iter(execute(every, folder, request.jobs, listener, interruption))
    listener.close()
    outcomes = {path: (Outcome.of_invalid(file_name(path), error),) for path, error in invalid.items()} | {
        path: compared(valid[path], tuple(islice(ran, len(several))), folder) for path, several in runs.items()
    }
    return [outcome for path in files for outcome in outcomes[path]]


def _seeded(loaded: LoadedScenario, seed: int | None) -> LoadedScenario:
    """The scenario with the seed that was typed; None: with its own."""
    return loaded if seed is None else replace(loaded, scenario=loaded.scenario.model_copy(update={"seed": seed}))
