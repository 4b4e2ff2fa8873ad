"""`sim-action rostest` and `sim-action roslaunch`, from a file to reports: overlay -> launch -> judge -> report."""

from __future__ import annotations

import os
import platform
import tempfile
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from sim_action import __version__
from sim_action.core.errors import ExitCode, InvalidScenario
from sim_action.core.process import Interruption
from sim_action.reports import ReportOptions
from sim_action.reports.writing import ReportRequest, make_ready, report_options, write_reports
from sim_action.results.file import Results
from sim_action.results.outcome import Outcome
from sim_action.results.trace_files import copy_stored, replay_path, trace_paths
from sim_action.ros.ros1.exchange import REPLAY_FILE, TRACE_FILE
from sim_action.ros.ros1.findings import Run
from sim_action.ros.ros1.installation import find_ros
from sim_action.ros.ros1.judging import Judge
from sim_action.ros.ros1.launching import Call
from sim_action.ros.ros1.overlay import build_overlay
from sim_action.ros.ros1.request import RosRequest
from sim_action.ros.ros1.scratch import scratch_parent
from sim_action.ros.ros1.traceback_text import shown_path


def run(request: RosRequest, reports: ReportRequest, interruption: Interruption) -> ExitCode:
    """Runs the launch, writes every report, and returns what the process says to its caller. Raises UsageError."""
    started = time.monotonic()
    ros = find_ros()
    options = report_options(reports)
    with tempfile.TemporaryDirectory(prefix="sim-action-", dir=scratch_parent(), ignore_cleanup_errors=True) as scratch:
        folder = Path(os.path.realpath(scratch))
        overlay = build_overlay(_made(folder / "overlay"), ros, request.workspace.resolve())
        call = Call(request, ros, overlay, _made(folder / "call"))
        outcomes = tuple(_outcomes(call, options, interruption))
    results = Results(
        sim_action=__version__,
        python=platform.python_version(),
        platform=platform.platform(),
        wall_time=time.monotonic() - started,
        outcomes=outcomes,
    )
    write_reports(results, options)
    return results.exit_code


def _outcomes(call: Call, options: ReportOptions, interruption: Interruption) -> Iterator[Outcome]:
    """With the trace and the replay of each where those of other runs are."""
    request, results, started = call.request, options.folder, time.monotonic()
    try:
        file = call.file()
    except InvalidScenario as error:
        known = {"name": f"{request.package}/{request.file}", "call": request.words}
        yield Outcome.of_invalid(request.file, error).model_copy(update=known)
        return
    findings = call.launched(file, interruption, partial(make_ready, options))
    judged = Judge(request, shown_path(file.resolve()), time.monotonic() - started).outcomes(findings)
    paths = trace_paths([outcome.name for outcome, _ in judged], results)
    for (outcome, run), path in zip(judged, paths, strict=True):
        yield _stored(outcome, run, path, results)


def _stored(outcome: Outcome, run: Run | None, path: Path, results: Path) -> Outcome:
    if run is None:
        return outcome
    copies = {"trace": (run.folder / TRACE_FILE, path), "replay": (run.folder / REPLAY_FILE, replay_path(path))}
    kept = {key: _copied(source, target, results) for key, (source, target) in copies.items()}
    return outcome.model_copy(update=kept)


def _copied(source: Path, target: Path, results: Path) -> str | None:
    if not source.is_file():
        return None
    target.parent.mkdir(parents=True, exist_ok=True)
    copy_stored(source, target)
    return target.relative_to(results).as_posix()


def _made(folder: Path) -> Path:
    folder.mkdir()
    return folder
