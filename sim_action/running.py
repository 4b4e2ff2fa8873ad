"""`sim-action run`, from files to reports: load -> execute -> report."""

from __future__ import annotations

import os
import platform
import time
from dataclasses import dataclass
from pathlib import Path

from sim_action import __version__
from sim_action.errors import ExitCode, UsageError
from sim_action.execution import execute
from sim_action.loading import load_all
from sim_action.outcome import Outcome, Results
from sim_action.reports import REPORTS, ReportOptions, Verbosity
from sim_action.reports.progress import ProgressListener


@dataclass(frozen=True, slots=True)
class RunRequest:
    """What the command line asks for; `folder` and `junit` as they were typed."""

    files: list[Path]
    folder: Path
    junit: Path | None
    junit_strict: bool
    jobs: int
    verbosity: Verbosity
    allow_outside: bool


def run(request: RunRequest) -> ExitCode:
    """Runs everything, writes every report, and returns what the process says to its caller."""
    started = time.monotonic()
    folder = _created(request.folder)
    valid, invalid = load_all(request.files, allow_outside=request.allow_outside)
    listener = ProgressListener(total=len(valid), verbosity=request.verbosity)
    try:
        ran = execute(list(valid.values()), folder, request.jobs, listener)
    finally:
        listener.close()
    outcomes = dict(zip(valid, ran, strict=True)) | {
        path: Outcome.of_invalid(str(path), error) for path, error in invalid.items()
    }
    results = Results(
        sim_action=__version__,
        python=platform.python_version(),
        platform=platform.platform(),
        wall_time=time.monotonic() - started,
        outcomes=tuple(outcomes[path] for path in request.files),
    )
    results.write(folder)
    options = _report_options(request, folder)
    for name in REPORTS:
        REPORTS.load(name)(results, options)
    return results.exit_code


def _created(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"cannot write to the output folder {folder}: {error.strerror}") from None
    return folder


def _report_options(request: RunRequest, folder: Path) -> ReportOptions:
    return ReportOptions(
        folder=folder,
        junit=request.junit or folder / "junit.xml",
        junit_strict=request.junit_strict,
        environment=os.environ,
        workspace=Path(os.environ.get("GITHUB_WORKSPACE") or Path.cwd()),
        verbosity=request.verbosity,
    )
