"""The command `sim-action launchtest`: launch_testing runs a test, and the robot that it spawns is simulated."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

from sim_action.core.errors import (
    ControllersFinished,
    ExitCode,
    InvalidScenario,
    Location,
    ModelError,
    Problem,
    RunError,
    ScriptError,
    SourceProblem,
)
from sim_action.core.field_types import Placement
from sim_action.core.process import Interruption
from sim_action.core.records import dataclass, replace
from sim_action.core.wording import did_you_mean, escaped_line, warn
from sim_action.core.workspace import PathError, Workspace
from sim_action.engines import AutoOrEngine
from sim_action.reports import ReportRequest
from sim_action.reports.writing import open_reports, write_reports
from sim_action.results.journal import Finished, Header, Journal, Planned
from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome, status_of
from sim_action.robot.documents.xml_document import shown_file
from sim_action.robot.reading.loading import load_model
from sim_action.ros import node_start
from sim_action.ros.launches import LaunchRequest, OpenCommands
from sim_action.ros.program_failures import traceback_location
from sim_action.ros.result_files import Case, expectation_of, read_suite
from sim_action.ros.ros2.bridge_link import BridgeEnded, Endpoint
from sim_action.ros.ros2.driven_nodes import DrivenNodes, Session, controller_of, robot_channels
from sim_action.ros.ros2.graph import LATCHED
from sim_action.ros.ros2.installation import find_ros
from sim_action.ros.ros2.launch.launched_nodes import LaunchedNodes, LaunchSpec
from sim_action.ros.ros2.packages import Packages, workspace_of
from sim_action.ros.ros2.spec import Ros2Commands, Ros2Nodes
from sim_action.runner.isolation.child_process import environment
from sim_action.scenario.model import DrivenRobot, Scenario, Stage
from sim_action.simulation.loop import SimulationRun, simulate
from sim_action.world import Physics
from sim_action.world.claims import NOT_SIMULATED, AuditWarning
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.ros.lost_parts import LeftOutProgram
    from sim_action.ros.ros2.bridge_link import Bridge

SPAWNERS: Final = frozenset({"ros_gz_sim/create", "ros_ign_gazebo/create"})
_SOURCES: Final = ("-topic", "-string", "-file")
_TEXT: Final = "std_msgs/msg/String"
_MAX_WAIT_S: Final = 20.0
_POLL_S: Final = 0.01
_PHYSICS_RATE_HZ: Final = 200.0
_MAX_SIM_TIME_S: Final = 60.0
_RUN_FIELDS: Final = ("end", "sim_time", "travelled", "digest", "engine", "notes", "model_notes")

# Rules about driving. A launch test may be about something else, and no file of it can allow a finding.
_OF_DRIVING: Final = frozenset({"silent-controller", "drive-never-commanded"})


@dataclass(frozen=True, slots=True)
class SpawnedRobot:
    """The robot of a launch test; `file`: its description."""

    name: str
    file: Path
    pose: Placement


def spawned_robot(programs: Sequence[LeftOutProgram], bridge: Bridge, folder: Path) -> SpawnedRobot:
    """Return the robot that a launch spawns; `folder`: for its description. Raise ScriptError, BridgeEnded."""
    spawned = [_options(program.args) for program in programs if program.program in SPAWNERS]
    robots = [options for options in spawned if "-file" not in options] or spawned
    if not robots:
        raise ScriptError("the launch spawns no robot: no action runs 'create' of ros_gz_sim")
    options = robots[0]
    source = next((key for key in _SOURCES if key in options), None)
    if source is None:
        raise ScriptError("'create' of ros_gz_sim has none of -topic, -string and -file, so there is no robot to spawn")
    name = options.get("-name", "robot")
    if source == "-file":
        return SpawnedRobot(name, Path(options[source]), _pose(options))
    text = options[source] if source == "-string" else _heard("/" + options[source].lstrip("/"), bridge)
    file = folder / "robot.urdf"
    file.write_text(text, encoding="utf-8")
    return SpawnedRobot(name, file, _pose(options))


def _options(args: Sequence[str]) -> Mapping[str, str]:
    """Return the options of `create` with their values; both `-x 1` and `--x=1` are allowed."""
    options: dict[str, str] = {}
    words = iter(args)
    for word in words:
        if word == "--ros-args":
            break
        if word.startswith("-"):
            name, sign, value = word.partition("=")
            options["-" + name.lstrip("-")] = value if sign else next(words, "")
    return options


def _pose(options: Mapping[str, str]) -> Placement:
    """Return the pose. At a height of 0 or less, the robot stands on the ground. Raise ScriptError."""
    names = {"-x": "x", "-y": "y", "-z": "z", "-R": "roll", "-P": "pitch", "-Y": "yaw"}
    values: dict[str, float] = {}
    for option, name in names.items():
        try:
            values[name] = float(options.get(option, 0.0))
        except ValueError:
            raise ScriptError(f"'create {option} {options[option]}': this is not a number") from None
    return Placement.model_validate({**values, "z": values["z"] if values["z"] > 0 else None})


def _heard(topic: str, bridge: Bridge) -> str:
    """Return the text of a topic such as /robot_description. Raise ScriptError, BridgeEnded."""
    number = len(bridge.heard)
    bridge.open((), [Endpoint(topic, _TEXT, LATCHED)])
    deadline = time.monotonic() + _MAX_WAIT_S
    while time.monotonic() < deadline:
        for place, message in bridge.take(())[0]:
            if place == number:
                return str(message["data"])
        time.sleep(_POLL_S)
    raise ScriptError(f"no description of the robot arrived on {topic} within {_MAX_WAIT_S:g} s of wall time")


def run(request: LaunchRequest, reports: ReportRequest, interruption: Interruption) -> ExitCode:
    """Run the test, write every report, and return the exit code. Raises UsageError."""
    started = time.monotonic()
    find_ros()
    with open_reports(reports) as options:
        outcome = _outcome(request, interruption, started)
        header = Header.of_call((Planned.of(outcome),), options.files)
        journal = Journal(options.folder, header, warn, started)
        journal(Finished(0, outcome))
        return write_reports(journal.close(), options)


def _outcome(request: LaunchRequest, interruption: Interruption, started: float) -> Outcome:
    name = f"{request.package}/{request.file}"
    about: dict[str, Any] = {"name": name, "seed": request.seed, "call": request.words}
    try:
        file, packages = _test_file(request)
    except InvalidScenario as error:
        return Outcome.of_invalid(request.file, error).model_copy(update=about)
    test = _LaunchTest(request, file, packages, interruption)
    about |= {"file": shown_file(file), **test.run(), "wall_time": time.monotonic() - started}
    outcome = Outcome(**about)
    return outcome.judged_strictly(NOT_SIMULATED) if request.strict else outcome


def _test_file(request: LaunchRequest) -> tuple[Path, Packages]:
    """Return the test and the packages. Raise InvalidScenario."""
    root = request.workspace.resolve()
    try:
        packages = Packages.around(workspace_of(None, Workspace(root, root)), find_ros())
    except PathError as error:
        raise _invalid(request, str(error)) from None
    source = packages.sources.get(request.package)
    prefix = packages.prefix(request.package)
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


def _invalid(request: LaunchRequest, message: str) -> InvalidScenario:
    return InvalidScenario([Problem(Location(request.file), escaped_line(message))])


class _LaunchTest:
    """One test: its launch, its simulation and its results."""

    def __init__(self, request: LaunchRequest, file: Path, packages: Packages, interruption: Interruption) -> None:
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
                place = getattr(error, "location", None) or Location(shown_file(self._file))
                failure = Failure(kind="script", title=title, message=escaped_line(str(error)), location=place)
            undo.close()
            expectations = tuple(self._expectations(run.sim_time if run else None))
        measured = _measured(run, Location(shown_file(self._file)))
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
        asked = Ros2Nodes(launch=words, allow_losses=request.allows_losses)
        rate = Ros2Commands(ros2=asked).rate
        workspace = Workspace(self._root, self._root, allow_outside=True)
        ros = self._packages.ros
        assert ros is not None
        inherited = {**environment(request.pass_env), **node_start.variables(request.seed)}
        session = Session.open(asked, ros, workspace, inherited, undo)
        self._results = session.folder.path / "results.xml"
        spec = LaunchSpec(
            self._file,
            ros.python,
            request.arguments,
            self._root,
            allows_losses=request.allows_losses,
            results=self._results,
            package=request.package,
        )
        launched = LaunchedNodes(spec, session.folder)
        undo.callback(self._keep_results)
        undo.callback(launched.close)
        programs = launched.await_programs()
        session.bridge.await_start()
        robot = spawned_robot(programs, session.bridge, session.folder.path)
        scenario, scene = self._scene(robot, workspace)
        launched.topics = robot_channels(asked, rate, scene)
        nodes = DrivenNodes(asked, rate, scene, session, launched)
        scenario = scenario.model_copy(update={"commands": (OpenCommands.of(controller_of(nodes), rate),)})
        run = simulate(scenario, scene, self._look_at_interruption)
        left_out = frozenset[str]() if nodes.has_heard else _OF_DRIVING
        return replace(run, findings=tuple(finding for finding in run.findings if finding.rule not in left_out))

    def _scene(self, robot: SpawnedRobot, workspace: Workspace) -> tuple[Scenario, Scene]:
        """Return the scenario of the spawned robot, and its scene. Raise ModelError."""
        request = self._request
        driven = DrivenRobot(model=str(robot.file), pose=robot.pose)
        model = load_model(driven, workspace)
        scenario = Scenario.model_construct(
            name=robot.name,
            robot=driven,
            world=Stage(),
            physics=Physics(rate=_PHYSICS_RATE_HZ),
            commands=(),
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
            place = traceback_location(case.text, self._root) or Location(shown_file(self._file))
            last = case.text.strip().rpartition("\n")[2]
            shown = replace(case, text=last) if case.problem == "skipped" else case
            yield expectation_of(shown, "launchtest", place, sim_time, last)


def _measured(run: SimulationRun | None, where: Location) -> dict[str, Any]:
    """Return the fields of an outcome that are known from a run; `where`: the place of its warnings."""
    if run is None:
        return {}
    warnings = (AuditWarning(rule=finding.rule, message=finding.message, location=where) for finding in run.findings)
    return {**{key: getattr(run, key) for key in _RUN_FIELDS}, "warnings": tuple(warnings)}
