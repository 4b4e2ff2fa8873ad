"""The command `sim-action launchtest`: launch_testing runs a test, and the robot that it spawns is simulated."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final, cast

from pydantic import PrivateAttr
from typing_extensions import override

from sim_action.commands import ClosedLoop, CommandSource, Controller
from sim_action.core.errors import (
    ControllersFinished,
    ExitCode,
    InvalidScenario,
    Location,
    ModelError,
    Problem,
    RunError,
    SourceProblem,
)
from sim_action.core.process import Interruption
from sim_action.core.records import dataclass
from sim_action.core.wording import did_you_mean, escaped_line, warn
from sim_action.core.workspace import Workspace
from sim_action.engines import AutoOrEngine
from sim_action.reports import ReportRequest, open_reports, write_reports
from sim_action.results.events import Finished
from sim_action.results.journal import Journal
from sim_action.results.journal_records import Header, Planned
from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome, status_of
from sim_action.robot.reading.loading import load_model
from sim_action.ros.program_failures import shown_path, traceback_location
from sim_action.ros.result_files import Case, read_suite
from sim_action.ros.ros2.bridge_link import BridgeEnded
from sim_action.ros.ros2.driven_nodes import DrivenNodes, Session, controller_of, robot_topics
from sim_action.ros.ros2.installation import find_ros
from sim_action.ros.ros2.launch.launched_nodes import LaunchedNodes, LaunchSpec, RobotTopics
from sim_action.ros.ros2.launch.spawned_robot import SpawnedRobot, spawned_robot
from sim_action.ros.ros2.packages import Packages, workspace_of
from sim_action.ros.ros2.spec import Ros2Commands, Ros2Nodes
from sim_action.runner.isolation.child_process import environment
from sim_action.scenario.model import DrivenRobot, Scenario
from sim_action.simulation.loop import SimulationRun, simulate
from sim_action.state.verdict import Judged, Verdict
from sim_action.world import Physics, World
from sim_action.world.scene import Scene

_PHYSICS_RATE_HZ: Final = 200.0
_MAX_SIM_TIME_S: Final = 60.0


@dataclass(frozen=True, slots=True)
class LaunchTestRequest:
    """The request of one call of launchtest.

    Attributes:
        file: name of the test in the package, or its path.
        arguments: `NAME:=VALUE`.
        sim_time_limit: s after which the simulation ends; None: 60.
        allows_losses: True if parts that are not simulated are warnings instead of errors.
        pass_env: names of environment variables that nodes may see, in addition to the harmless ones.
    """

    package: str
    file: str
    arguments: tuple[str, ...] = ()
    workspace: Path = Path()
    backend: str = "auto"
    seed: int = 0
    sim_time_limit: float | None = None
    allows_losses: bool = False
    pass_env: tuple[str, ...] = ()

    @property
    def words(self) -> tuple[str, ...]:
        """The command line that repeats the call."""
        limit = ("--sim-time-limit", f"{self.sim_time_limit:g}") if self.sim_time_limit else ()
        names = (word for name in self.pass_env for word in ("--pass-env", name))
        options = ("--workspace", str(self.workspace), "--seed", str(self.seed), *limit, *names)
        return ("sim-action", "launchtest", *options, self.package, self.file, *self.arguments)


class GroupCommands(CommandSource):
    """The commands of nodes that already run. No key of a scenario leads here."""

    _nodes: DrivenNodes = PrivateAttr()

    @classmethod
    def of(cls, nodes: DrivenNodes, rate: float) -> GroupCommands:
        """Return the commands of nodes."""
        source = cls(rate=rate)
        source._nodes = nodes
        return source

    @override
    def open(self, scene: Scene) -> Controller:
        found = controller_of(self._nodes)
        assert isinstance(found, ClosedLoop)
        return found


def run(request: LaunchTestRequest, reports: ReportRequest, interruption: Interruption) -> ExitCode:
    """Run the test, write every report, and return the exit code. Raises UsageError."""
    started = time.monotonic()
    find_ros()
    with open_reports(reports) as options:
        outcome = _outcome(request, interruption, started)
        header = Header.of_call((Planned.of(outcome),), options.files)
        journal = Journal(options.folder, header, warn, started)
        journal(Finished(0, outcome))
        return write_reports(journal.close(), options)


def _outcome(request: LaunchTestRequest, interruption: Interruption, started: float) -> Outcome:
    name = f"{request.package}/{request.file}"
    about: dict[str, Any] = {"name": name, "seed": request.seed, "call": request.words}
    try:
        file, packages = _test_file(request)
    except InvalidScenario as error:
        return Outcome.of_invalid(request.file, error).model_copy(update=about)
    test = _LaunchTest(request, file, packages, interruption)
    about |= {"file": shown_path(file), **test.run(), "wall_time": time.monotonic() - started}
    return Outcome(**about)


def _test_file(request: LaunchTestRequest) -> tuple[Path, Packages]:
    """Return the test and the packages. Raise InvalidScenario."""
    root = request.workspace.resolve()
    packages = Packages.around(workspace_of(None, Workspace(root, root)), find_ros())
    source, prefix = packages.sources.get(request.package), packages.prefix(request.package)
    if source is None and prefix is None:
        hint = did_you_mean(request.package, packages.names)
        raise _invalid(request, f"there is no package '{request.package}' in {root} or ROS 2{hint}")
    if Path(request.file).is_file():
        return Path(request.file).resolve(), packages
    share = source.folder if source else cast(Path, prefix) / "share" / request.package
    files = {path.name: path for path in sorted(share.rglob("*.py")) if "test" in path.name}
    if request.file not in files:
        raise _invalid(request, f"the package has no test '{request.file}'{did_you_mean(request.file, files)}")
    return files[request.file], packages


def _invalid(request: LaunchTestRequest, message: str) -> InvalidScenario:
    return InvalidScenario([Problem(Location(request.file), escaped_line(message))])


class _LaunchTest:
    """One test: its launch, its simulation and its results."""

    def __init__(self, request: LaunchTestRequest, file: Path, packages: Packages, interruption: Interruption) -> None:
        self._request, self._file, self._packages = request, file, packages
        self._interruption = interruption
        self._root = request.workspace.resolve()
        self._cases: tuple[Case, ...] = ()

    def run(self) -> dict[str, Any]:
        """Return the fields of the outcome."""
        failure, run = None, None
        with ExitStack() as undo:
            try:
                run = self._simulated(undo)
            except ControllersFinished:
                pass
            except (RunError, ModelError, SourceProblem, BridgeEnded) as error:
                title = "not simulated" if isinstance(error, SourceProblem) else "the simulation failed"
                place = getattr(error, "location", None) or Location(shown_path(self._file))
                failure = Failure(kind="script", title=title, message=escaped_line(str(error)), location=place)
            undo.close()
            expectations = tuple(self._expectations(run.sim_time if run else None))
        measured = _measured(run)
        if failure is None and not expectations:
            message = "the test wrote no results: it has no method whose name begins with 'test', or it was interrupted"
            failure = Failure(kind="script", title="no test ran", message=message, location=Location(str(self._file)))
        if failure is not None:
            return {"status": "error", "failures": (failure,), **measured}
        return {"status": status_of(expectations), "expectations": expectations, **measured}

    def _simulated(self, undo: ExitStack) -> SimulationRun:
        """Launch the test, and simulate its robot to the end. Raise RunError and others."""
        request = self._request
        words = (request.package, self._file.name, *request.arguments)
        source = Ros2Commands(ros2=Ros2Nodes(launch=words, allow_losses=request.allows_losses))
        workspace = Workspace(self._root, self._root, allow_outside=True)
        ros = self._packages.ros
        assert ros is not None
        session = Session.open(source.ros2, ros, workspace, environment(request.pass_env), undo)
        self._results = session.folder.path / "results.xml"
        nothing = RobotTopics(frozenset(), frozenset())
        spec = LaunchSpec(
            self._file,
            ros.python,
            request.arguments,
            self._root,
            nothing,
            request.allows_losses,
            self._results,
            request.package,
        )
        launched = LaunchedNodes(spec, session.folder)
        undo.callback(self._keep_results)
        undo.callback(launched.close)
        programs = launched.await_programs()
        session.bridge.await_start()
        robot = spawned_robot(programs, session.bridge, session.folder.path)
        scenario, scene = self._scene(robot, workspace, source)
        launched.topics = robot_topics(source, scene)
        nodes = DrivenNodes(source, scene, session, launched)
        scenario = scenario.model_copy(update={"commands": (GroupCommands.of(nodes, source.rate),)})
        return simulate(scenario, scene, self._look_at_interruption)

    def _scene(self, robot: SpawnedRobot, workspace: Workspace, source: Ros2Commands) -> tuple[Scenario, Scene]:
        """Return the scenario of the spawned robot, and its scene. Raise ModelError."""
        request = self._request
        driven = DrivenRobot(model=str(robot.file), pose=robot.pose)
        model = load_model(driven, workspace)
        scenario = Scenario.model_construct(
            name=robot.name,
            robot=driven,
            world=World(),
            physics=Physics(rate=_PHYSICS_RATE_HZ),
            commands=(source,),
            sensors=(),
            expect=(),
            time_limit=request.sim_time_limit or _MAX_SIM_TIME_S,
            backend=cast(AutoOrEngine, request.backend),
            seed=request.seed,
        )
        return scenario, Scene(driven, model, scenario.world, scenario.physics, workspace, scenario.seed)

    def _look_at_interruption(self, _: object) -> None:
        if self._interruption.happened:
            raise ControllersFinished("the run was interrupted")

    def _keep_results(self) -> None:
        suite = read_suite(self._results) if self._results.is_file() else None
        self._cases = suite.cases if suite else ()

    def _expectations(self, sim_time: float | None) -> Iterator[ExpectationOutcome]:
        for case in self._cases:
            place = traceback_location(case.text, self._root) or Location(shown_path(self._file))
            yield ExpectationOutcome(
                name=case.name or "unnamed",
                assertion="launchtest",
                severity="error",
                location=place,
                verdict=_verdict(case, sim_time),
            )


def _verdict(case: Case, sim_time: float | None) -> Verdict:
    if case.problem is None:
        return Verdict(passed=True, time=sim_time, message="held")
    said = escaped_line(case.text.strip().rpartition("\n")[2])
    if case.problem == "skipped":
        return Verdict(passed=False, message=f"never checked: the test skipped this case ({said})", judged=Judged())
    return Verdict(passed=False, time=sim_time, message=said)


def _measured(run: SimulationRun | None) -> dict[str, Any]:
    """Return the fields of an outcome that are known from a run."""
    if run is None:
        return {}
    return {
        "end": run.end,
        "sim_time": run.sim_time,
        "travelled": run.travelled,
        "digest": run.digest,
        "engine": run.engine,
        "notes": run.notes,
        "model_notes": run.model_notes,
    }
