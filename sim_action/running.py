"""`sim-action run`, from files to reports: load -> execute -> report."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from sim_action import __version__
from sim_action.discovery import file_name
from sim_action.errors import ExitCode, InvalidScenario, UsageError
from sim_action.execution import execute
from sim_action.interruption import Interruption
from sim_action.loading import load_all
from sim_action.location import Location, Problem
from sim_action.messages import escaped_line
from sim_action.outcome import Outcome, Results
from sim_action.reports import REPORTS, ReportOptions, Verbosity
from sim_action.reports.progress import ProgressListener


@dataclass(frozen=True, slots=True)
class RunRequest:
    """What the command line asks for, as it was typed; `empty`: what was named but holds no scenario."""

    files: list[Path]
    empty: list[str]
    folder: Path
    junit: Path | None
    junit_strict: bool
    jobs: int
    verbosity: Verbosity
    allow_outside: bool


def run(request: RunRequest, interruption: Interruption) -> ExitCode:
    """Runs everything, writes every report, and returns what the process says to its caller."""
    started = time.monotonic()
    options = _report_options(request)
    valid, invalid = load_all(request.files, allow_outside=request.allow_outside)
    listener = ProgressListener(total=len(valid), verbosity=request.verbosity)
    ran = execute(list(valid.values()), options.folder, request.jobs, listener, interruption)
    listener.close()
    outcomes = dict(zip(valid, ran, strict=True)) | {
        path: Outcome.of_invalid(file_name(path), error) for path, error in invalid.items()
    }
    results = Results(
        sim_action=__version__,
        python=platform.python_version(),
        platform=platform.platform(),
        wall_time=time.monotonic() - started,
        outcomes=(*(outcomes[path] for path in request.files), *_missing(request)),
    )
    _report(results, options)
    return results.exit_code


def _missing(request: RunRequest) -> Iterator[Outcome]:
    """A test that was asked for and is not there must not pass; if there is none at all, the exit code says so."""
    for pattern in request.empty if request.files else ():
        name = escaped_line(pattern)
        problem = Problem(Location(name), "no scenario is there; correct the path or leave it out")
        yield Outcome.of_invalid(name, InvalidScenario([problem]))


def _report(results: Results, options: ReportOptions) -> None:
    """Writes what can be written; raises UsageError for the rest."""
    failed = []
    writers = {"results": lambda: results.write(options.folder)} | {
        name: partial(REPORTS.load(name), results, options) for name in REPORTS
    }
    for name, write in writers.items():
        try:
            write()
        except BrokenPipeError:
            # Whoever read the output has gone; that changes no verdict.
            continue
        except OSError as error:
            failed.append(f"the {name} report cannot be written: {error.filename or name}: {error.strerror}")
    if failed:
        raise UsageError("; ".join(failed))


def _created(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"cannot write to the output folder {folder}: {error.strerror}") from None
    return folder


def _report_options(request: RunRequest) -> ReportOptions:
    folder = _created(request.folder)
    if request.junit is not None and request.junit.is_dir():
        raise UsageError(f"--junit {request.junit} is a folder; name a file")
    return ReportOptions(
        folder=folder,
        junit=request.junit or folder / "junit.xml",
        junit_strict=request.junit_strict,
        environment=os.environ,
        workspace=Path(os.environ.get("GITHUB_WORKSPACE") or Path.cwd()),
        verbosity=request.verbosity,
    )
