"""`sim-action run`, from files to reports: load -> execute -> report."""

from __future__ import annotations

import platform
import time
from dataclasses import dataclass
from pathlib import Path

from sim_action import __version__
from sim_action.discovery import file_name
from sim_action.errors import ExitCode
from sim_action.execution import execute
from sim_action.interruption import Interruption
from sim_action.loading import load_all
from sim_action.outcome import Outcome, Results
from sim_action.permissions import Permissions
from sim_action.reporting import ReportRequest, report_options, write_reports
from sim_action.reports.progress import ProgressListener
from sim_action.sharding import Shard


@dataclass(frozen=True, slots=True)
class RunRequest:
    """What the command line asks for; `empty`: what was named but holds no scenario; `shard`: as it was typed."""

    files: list[Path]
    empty: list[str]
    shard: str | None
    jobs: int
    permissions: Permissions
    reports: ReportRequest


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
    """Of each file, in their order."""
    valid, invalid = load_all(files, request.permissions)
    listener = ProgressListener(total=len(valid), verbosity=request.reports.verbosity)
    ran = execute(list(valid.values()), folder, request.jobs, listener, interruption)
    listener.close()
    outcomes = dict(zip(valid, ran, strict=True)) | {
        path: Outcome.of_invalid(file_name(path), error) for path, error in invalid.items()
    }
    return [outcomes[path] for path in files]
