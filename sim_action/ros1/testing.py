"""`sim-action rostest` and `sim-action roslaunch`, from a file to reports: overlay -> launch -> watch -> judge."""

from __future__ import annotations

import os
import platform
import shutil
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sim_action import __version__
from sim_action.discovery import file_name
from sim_action.errors import ExitCode, InvalidScenario
from sim_action.interruption import Interruption
from sim_action.location import Location, Problem
from sim_action.messages import did_you_mean, escaped_line
from sim_action.outcome import Outcome, Results
from sim_action.reporting import ReportRequest, report_options, write_reports
from sim_action.ros1.exchange import REPLAY_FILE, REQUEST_FILE, TRACE_FILE, Request
from sim_action.ros1.findings import RESULTS, Findings, find
from sim_action.ros1.installation import Ros, find_ros
from sim_action.ros1.judging import Judge
from sim_action.ros1.launch import Launch
from sim_action.ros1.launch_file import TestTag, test_tags
from sim_action.ros1.overlay import Overlay, build_overlay
from sim_action.ros1.request import RosRequest
from sim_action.ros1.watch import Watch
from sim_action.trace_files import replay_path, trace_paths

# In s: what a launch without tests lasts, if nobody says how long; what each test may take beside its own limit.
_LAUNCH_TIME: Final = 30.0
_STARTING: Final = 60.0


def run(request: RosRequest, reports: ReportRequest, interruption: Interruption) -> ExitCode:
    """Runs the launch, writes every report, and returns what the process says to its caller. Raises UsageError."""
    started = time.monotonic()
    ros = find_ros()
    options = report_options(reports)
    with tempfile.TemporaryDirectory(prefix="sim-action-", ignore_cleanup_errors=True) as scratch:
        folder = Path(os.path.realpath(scratch))
        overlay = build_overlay(_made(folder / "overlay"), ros, request.workspace.resolve())
        outcomes = tuple(_outcomes(request, ros, overlay, _made(folder / "call"), options.folder, interruption))
    results = Results(
        sim_action=__version__,
        python=platform.python_version(),
        platform=platform.platform(),
        wall_time=time.monotonic() - started,
        outcomes=outcomes,
    )
    write_reports(results, options)
    return results.exit_code


def _outcomes(
    request: RosRequest, ros: Ros, overlay: Overlay, folder: Path, results: Path, interruption: Interruption
) -> Iterator[Outcome]:
    try:
        file = _found(request, overlay)
    except InvalidScenario as error:
        yield Outcome.of_invalid(request.file, error).model_copy(update={"name": f"{request.package}/{request.file}"})
        return
    started = time.monotonic()
    tags = test_tags(file)
    findings = _launched(request, ros, overlay, folder, file, tags, interruption)
    judge = Judge(request, _shown(file), time.monotonic() - started)
    outcomes = list(judge.outcomes(findings))
    yield from _stored(outcomes, findings, results)


def _found(request: RosRequest, overlay: Overlay) -> Path:
    """The launch file, in the package as the overlay has it. Raises InvalidScenario."""
    package = overlay.packages.get(request.package)
    if package is None:
        hint = did_you_mean(request.package, overlay.packages)
        raise _invalid(request, f"there is no package '{request.package}' in {request.workspace} or in ROS{hint}")
    if (file := package / request.file).is_file():
        return file
    below = sorted(path for path in package.rglob(Path(request.file).name) if path.is_file())
    if not below:
        names = {path.name for path in package.rglob("*") if path.suffix in (".test", ".launch")}
        raise _invalid(request, f"the package has no file '{request.file}'{did_you_mean(request.file, names)}")
    return below[0]


def _invalid(request: RosRequest, message: str) -> InvalidScenario:
    return InvalidScenario([Problem(Location(request.file), escaped_line(message))])


def _launched(
    request: RosRequest,
    ros: Ros,
    overlay: Overlay,
    folder: Path,
    file: Path,
    tags: Sequence[TestTag],
    interruption: Interruption,
) -> Findings:
    (folder / REQUEST_FILE).write_text(_asked(request, ros, tags).model_dump_json(), encoding="utf-8")
    # As the overlay has it: rostest names its results by the folder of the package.
    seen = Path(overlay.variables["ROS_PACKAGE_PATH"]) / request.package
    inside = seen / file.relative_to(overlay.packages[request.package])
    words = [str(ros.program(request.program)), str(inside), *request.arguments]
    more = {"ROS_TEST_RESULTS_DIR": str(folder / RESULTS), "ROS_LOG_DIR": str(folder / "log")}
    limit = request.wall_limit or sum((tag.time_limit + _STARTING) * (1 + tag.retry) for tag in tags) + _STARTING
    launch = Launch.start(words, overlay, folder, more)
    try:
        watch = Watch(launch, time.monotonic() + limit, has_tests=request.program == "rostest")
        ending = watch.wait(interruption)
        code = launch.poll()
    finally:
        launch.close()
    return find(folder, tags, ending, code)


def _asked(request: RosRequest, ros: Ros, tags: Iterable[TestTag]) -> Request:
    """Of the node. Sim time ends where a test's own limit would end it in a simulation at real time."""
    limit = max((tag.time_limit for tag in tags), default=_LAUNCH_TIME)
    return Request(
        modules=str(ros.modules),
        backend=request.backend,
        seed=request.seed,
        sim_time_limit=request.sim_time_limit or limit,
        real_time_factor=request.real_time_factor,
        replay=request.replays,
    )


def _stored(outcomes: Sequence[Outcome], findings: Findings, results: Path) -> Iterator[Outcome]:
    """With the trace and the replay of each where those of other runs are."""
    runs = [test.run for test in findings.tests] or [*findings.runs[-1:], None]
    paths = trace_paths([outcome.name for outcome in outcomes], results)
    for outcome, run, path in zip(outcomes, runs, paths, strict=False):
        if run is None:
            yield outcome
            continue
        moved = {"trace": (run.folder / TRACE_FILE, path), "replay": (run.folder / REPLAY_FILE, replay_path(path))}
        kept = {key: _moved(source, target, results) for key, (source, target) in moved.items()}
        yield outcome.model_copy(update=kept)


def _moved(source: Path, target: Path, results: Path) -> str | None:
    if not source.is_file():
        return None
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.move(source, target)
    return target.relative_to(results).as_posix()


def _made(folder: Path) -> Path:
    folder.mkdir()
    return folder


def _shown(path: Path) -> str:
    here = Path.cwd().resolve()
    path = path.resolve()
    return file_name(path.relative_to(here) if path.is_relative_to(here) else path)
