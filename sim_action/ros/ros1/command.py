"""The commands `sim-action rostest` and `sim-action roslaunch`: overlay -> launch -> judge -> reports."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Final

from sim_action.core.errors import ExitCode, InvalidScenario, Location, Problem
from sim_action.core.process import Interruption
from sim_action.core.records import dataclass
from sim_action.core.wording import did_you_mean, escaped_line, warn
from sim_action.reports import ReportOptions, ReportRequest
from sim_action.reports.writing import make_ready, open_reports, write_reports
from sim_action.results.artifacts import copy_or_reason, replay_path, trace_paths
from sim_action.results.journal import Finished, Header, Journal, Planned
from sim_action.results.masking import Mask
from sim_action.results.outcome import Outcome
from sim_action.ros import node_start
from sim_action.ros.launches import LaunchRequest
from sim_action.ros.ros1.catkin_packages import find_launch_file
from sim_action.ros.ros1.installation import Ros, find_ros
from sim_action.ros.ros1.launch.launch_process import Launch, Watch, free_port
from sim_action.ros.ros1.launch.overlay import Overlay, build_overlay, scratch_parent
from sim_action.ros.ros1.launch_request import REPLAY_FILE, REQUEST_FILE, TRACE_FILE, SimulationRequest
from sim_action.ros.ros1.verdicts.findings import (
    LOGS,
    RESULTS,
    Findings,
    LaunchTags,
    Run,
    TestTag,
    collect_findings,
    test_tags,
)
from sim_action.ros.ros1.verdicts.judge import Judge
from sim_action.runner.isolation.child_process import environment
from sim_action.world.claims import NOT_SIMULATED

# Sim time of a launch without tests and without a limit; wall time of each test in addition to its own limit.
_LAUNCH_TIME_S: Final = 30.0
_STARTING_S: Final = 60.0

# Since Python 3.12, unittest lacks a method that rostest of ROS Noetic calls.
_ROSTEST: Final = """\
import sys
from unittest import TestCase
if not hasattr(TestCase, "assert_"):
    TestCase.assert_ = TestCase.assertTrue
from rostest import rostestmain
sys.argv[0] = "rostest"
rostestmain()
"""


@dataclass(frozen=True, slots=True)
class LaunchCall:
    """One call of the command; `folder`: an empty folder for its files."""

    request: LaunchRequest
    ros: Ros
    overlay: Overlay
    folder: Path

    def files(self) -> tuple[Path, ...]:
        """Return the paths of the requested launch files. Raises InvalidScenario."""
        return tuple(self._file(package, file) for package, file in self.request.files)

    def _file(self, package_name: str, file: str) -> Path:
        packages = self.overlay.packages
        package = packages.get(package_name)
        if package is None:
            hint = did_you_mean(package_name, packages)
            place = self.request.workspace.resolve()
            raise self._invalid(f"there is no package '{package_name}' in {place} or ROS{hint}")
        if (launch_file := find_launch_file(package, file)) is not None:
            return launch_file
        files = {path.name for path in package.rglob("*") if path.suffix in (".test", ".launch")}
        raise self._invalid(f"the package has no file '{file}'{did_you_mean(file, files)}")

    def launched(
        self, files: Sequence[Path], interruption: Interruption, meanwhile: Callable[[], object] = lambda: None
    ) -> Findings:
        """Launch the files, call `meanwhile`, and return the findings once all have ended. Raises UsageError."""
        tags = test_tags(files[0])
        asked = self._asked(tags)
        (self.folder / REQUEST_FILE).write_text(asked.model_dump_json(), encoding="utf-8")
        more = {
            "ROS_TEST_RESULTS_DIR": str(self.folder / RESULTS),
            "ROS_LOG_DIR": str(self.folder / LOGS),
            **node_start.variables(asked.seed),
        }
        launch = Launch.start(self._words(files), self.overlay, self.folder, more)
        try:
            meanwhile()
            stated = self.request.wall_limit
            usual = sum((tag.time_limit + _STARTING_S) * (1 + tag.retry) for tag in tags) + 2 * _STARTING_S
            watch = Watch(
                launch,
                time.monotonic() + (stated or usual),
                waits_for_progress=stated is None,
                has_tests=self.request.program == "rostest",
            )
            ending = watch.wait(interruption)
            code = launch.poll()
        finally:
            launch.close()
        share, workspace = self.overlay.variables["ROS_PACKAGE_PATH"], self.request.workspace.resolve()
        return collect_findings(self.folder, share, workspace, tags, (ending, code))

    def _words(self, files: Iterable[Path]) -> list[str]:
        """Return the command line. It names files in the overlay, because rostest names its results by package."""
        request, share = self.request, Path(self.overlay.variables["ROS_PACKAGE_PATH"])
        pairs = zip(request.files, files, strict=True)
        inside = [str(share / name / file.relative_to(self.overlay.packages[name])) for (name, _), file in pairs]
        if request.program == "rostest":
            # rostest finds a port for its master by itself.
            return [str(self.ros.python), "-c", _ROSTEST, *inside, *request.arguments]
        return [str(self.ros.program("roslaunch")), "-p", str(free_port()), *inside, *request.arguments]

    def _asked(self, tags: Iterable[TestTag]) -> SimulationRequest:
        """Return the request to the node. A test's own limit, taken as sim time, limits the simulation."""
        request = self.request
        limit = max((tag.time_limit for tag in tags), default=_LAUNCH_TIME_S)
        return SimulationRequest(
            modules=str(self.ros.modules),
            backend=request.backend,
            seed=request.seed,
            sim_time_limit=request.sim_time_limit or limit,
            limits_tests=request.sim_time_limit is not None,
            real_time_factor=request.real_time_factor,
            replay=request.replays,
            allows_losses=request.allows_losses,
        )

    def _invalid(self, message: str) -> InvalidScenario:
        return InvalidScenario([Problem(Location(self.request.file), escaped_line(message))])


def run(request: LaunchRequest, reports: ReportRequest, interruption: Interruption) -> ExitCode:
    """Run the launch, write every report, and return the exit code. Raises UsageError."""
    started = time.monotonic()
    ros = find_ros()
    with open_reports(reports) as options:
        outcomes = _launched(request, ros, options, interruption)
        stored = (name for outcome in outcomes for name in (outcome.trace, outcome.replay) if name is not None)
        header = Header.of_call(map(Planned.of, outcomes), (*options.files, *stored))
        journal = Journal(options.folder, header, warn, started)
        for place, outcome in enumerate(outcomes):
            journal(Finished(place, outcome))
        return write_reports(journal.close(), options)


def _launched(
    request: LaunchRequest, ros: Ros, options: ReportOptions, interruption: Interruption
) -> tuple[Outcome, ...]:
    """Launch in a scratch folder and return the outcomes. Raises UsageError."""
    with tempfile.TemporaryDirectory(prefix="sim-action-", dir=scratch_parent(), ignore_cleanup_errors=True) as scratch:
        folder = Path(os.path.realpath(scratch))
        variables = environment(request.pass_env)
        overlay = build_overlay(folder / "overlay", ros, request.workspace.resolve(), variables)
        (folder / "call").mkdir()
        return tuple(_outcomes(LaunchCall(request, ros, overlay, folder / "call"), options, interruption))


def _outcomes(call: LaunchCall, options: ReportOptions, interruption: Interruption) -> Iterator[Outcome]:
    """Yield the outcomes, with their traces and replays copied to the results folder."""
    request, results, started = call.request, options.folder, time.monotonic()
    try:
        files = call.files()
    except InvalidScenario as error:
        fields = {"name": f"{request.package}/{request.file}", "call": request.words}
        yield Outcome.of_invalid(request.file, error).model_copy(update=fields)
        return
    findings = call.launched(files, interruption, partial(make_ready, options))
    tags = LaunchTags.read(files, call.overlay.packages)
    mask = Mask.of(os.environ, request.pass_env)
    outcomes = Judge(request, tags, time.monotonic() - started).outcomes(findings)
    if request.strict:
        outcomes = [(outcome.judged_strictly(NOT_SIMULATED), run) for outcome, run in outcomes]
    judged = [(mask.outcome(outcome, names=True, states=False), run) for outcome, run in outcomes]
    paths = trace_paths([outcome.name for outcome, _ in judged], results)
    for (outcome, run), path in zip(judged, paths, strict=True):
        stored = _stored(outcome, run, path, results)
        if stored.replay is not None:
            mask.replay(results / stored.replay)
        yield stored


def _stored(outcome: Outcome, run: Run | None, path: Path, results: Path) -> Outcome:
    if run is None:
        return outcome
    copies = {"trace": (run.folder / TRACE_FILE, path), "replay": (run.folder / REPLAY_FILE, replay_path(path))}
    names = dict[str, str | None]()
    notes = list(outcome.notes)
    for kind, (source, target) in copies.items():
        exists = source.is_file()
        if reason := copy_or_reason(source, target) if exists else "":
            notes.append(f"{kind}: {reason}")
        names[kind] = target.relative_to(results).as_posix() if exists and not reason else None
    return outcome.model_copy(update={**names, "notes": tuple(notes)})
