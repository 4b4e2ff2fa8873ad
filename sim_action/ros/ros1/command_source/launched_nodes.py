"""The nodes that are launched for a scenario: started, watched and ended; and the simulation as one of them."""

from __future__ import annotations

import json
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from os import path
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from sim_action.commands import ClosedLoop
from sim_action.commands.stderr_tail import StderrTail
from sim_action.core.errors import ScriptError, SourceProblem, UsageError
from sim_action.core.records import dataclass
from sim_action.ros.processes import children
from sim_action.ros.ros1.catkin_packages import find_launch_file, workspace_of
from sim_action.ros.ros1.command import free_port
from sim_action.ros.ros1.command_source.file_problems import Packages, why_no_ros
from sim_action.ros.ros1.command_source.launch_events import Event, Events, LaunchErrors
from sim_action.ros.ros1.command_source.node_spec import launch_text
from sim_action.ros.ros1.installation import Ros, find_ros
from sim_action.ros.ros1.launch.launch_process import Launch
from sim_action.ros.ros1.launch.overlay import Overlay, build_overlay, scratch_parent
from sim_action.ros.ros1.verdicts.launch_output import callback_errors
from sim_action.ros.topic_names import topics_of

if TYPE_CHECKING:
    from sim_action.ros.ros1.command_source.spec import RosCommands, RosNodes
    from sim_action.ros.ros1.node.robot_node import RobotNode
    from sim_action.world.scene import Scene

_LAUNCHER: Final = Path(__file__).with_name("launcher.py")
# Packages whose nodes would wait forever for Gazebo, or for controllers of its plugins.
_LEFT_OUT: Final = ("gazebo_ros", "controller_manager")
_STANDARD_OUTPUT: Final = 1
_MAX_KEPT_BYTES: Final = 100_000
_POLL_S: Final = 0.005
# Wall time for reading and starting a launch file, for roslaunch to notice ended nodes, and for nodes to leave.
_MAX_START_S: Final = 60.0
_MAX_NOTICE_S: Final = 5.0
_MAX_SHUTDOWN_S: Final = 5.0

_KEY: Final = "ros1"


@dataclass(frozen=True, slots=True)
class LaunchSpec:
    """The input of a launch.

    Attributes:
        workspace: the catkin workspace.
        file: from the overlay and a scratch folder to the launch file.
        arguments: NAME:=VALUE.
        port: of the master.
        description: the robot's URDF.
        allows_losses: True if parts of the launch file that are not simulated are warnings instead of errors.
    """

    ros: Ros
    workspace: Path
    file: Callable[[Overlay, Path], Path]
    arguments: Sequence[str]
    port: int
    description: str
    allows_losses: bool = False


class LaunchedNodes:
    """All nodes of a scenario, without the simulation."""

    def __init__(self, asked: LaunchSpec) -> None:
        """Launch the nodes, and return at once. Raises UsageError."""
        with ExitStack() as undo:
            self._workspace = asked.workspace
            self.folder = Path(path.realpath(tempfile.mkdtemp(prefix="sim-action-", dir=scratch_parent())))
            undo.callback(shutil.rmtree, self.folder, ignore_errors=True)
            self.overlay = build_overlay(_made(self.folder / "overlay"), asked.ros, asked.workspace, os.environ)
            self._events = Events(self.folder / "events")
            undo.callback(self._events.close)
            self._launch = self._start(asked)
            undo.callback(self._launch.close)
            self._closing = undo.pop_all()
        self._words = StderrTail(self._launch.output_stream, _STANDARD_OUTPUT, _MAX_KEPT_BYTES)
        self._errors = LaunchErrors(asked.workspace, self.overlay, self._words)
        self._exited: set[int] = set()
        self.launcher = 0
        self._core = frozenset[int]()
        self._allows_losses = asked.allows_losses
        self.notes: list[str] = []
        self.losses: list[str] = []

    @property
    def _logs(self) -> Path:
        return self.folder / "log"

    def _start(self, asked: LaunchSpec) -> Launch:
        task: dict[str, Any] = {
            "events": str(self.folder / "events"),
            "file": str(asked.file(self.overlay, self.folder)),
            "arguments": list(asked.arguments),
            "port": asked.port,
            "left_out": _LEFT_OUT,
            "defaults": {"/robot_description": asked.description} if asked.description else {},
            "params": {"/use_sim_time": True},
        }
        (self.folder / "task.json").write_text(json.dumps(task), encoding="utf-8")
        words = [str(asked.ros.python), "-c", _LAUNCHER.read_text(encoding="utf-8"), str(self.folder / "task.json")]
        call = _made(self.folder / "call")
        more = {"ROS_LOG_DIR": str(self._logs), "ROS_MASTER_URI": f"http://localhost:{asked.port}"}
        return Launch.start(words, self.overlay, call, more, captures_output=True)

    def await_start(self) -> None:
        """Wait until all nodes are started. Raises ScriptError."""
        self._wait(lambda: self.launcher != 0, _MAX_START_S, "the nodes were not started")

    def await_exits(self, pids: Iterable[int]) -> None:
        """Wait until the exit codes of these processes are known. Raises ScriptError for a failed one."""
        wanted = set(pids)
        self._wait(lambda: wanted <= self._exited, _MAX_NOTICE_S, "")

    @property
    def exit_count(self) -> int:
        """The number of processes that are known to have ended."""
        return len(self._exited)

    def await_exit_count(self, number: int) -> None:
        """Wait a while until this many processes have ended. Raises ScriptError for a failed one."""
        self._look()
        self._wait(lambda: len(self._exited) >= number, _MAX_NOTICE_S, "")

    def _look(self) -> None:
        for event in self._events.new():
            self._take(event)

    def end_error(self) -> Exception:
        """Return the error for a master that does not answer any more."""
        return self._errors.of_end(self._launch.poll())

    def close(self) -> None:
        """Interrupt the launch, wait a moment for nodes that save something, and kill the rest."""
        self._launch.interrupt()
        deadline = time.monotonic() + _MAX_SHUTDOWN_S
        while self._launch.poll() is None and self._has_nodes() and time.monotonic() < deadline:
            time.sleep(_POLL_S)
        if self._logs.is_dir():
            self.notes += map(str, callback_errors(self._logs, None, self._workspace))
        self._closing.close()
        self._words.close()

    def _has_nodes(self) -> bool:
        return not self.launcher or not children(self.launcher) <= self._core

    def _wait(self, condition: Callable[[], bool], seconds: float, what: str) -> None:
        deadline = time.monotonic() + seconds
        while not condition():
            is_over = self._launch.poll() is not None
            self._look()
            if condition():
                return
            if is_over:
                raise self._errors.of_end(self._launch.poll())
            if time.monotonic() > deadline:
                if what:
                    raise self._errors.of_delay(f"{what} within {seconds:g} s of wall time")
                return
            time.sleep(_POLL_S)

    def _take(self, event: Event) -> None:
        if event.is_failure:
            raise self._errors.of_event(event)
        if event.event == "died":
            self._exited.add(event.pid)
        elif event.event == "started":
            self.launcher, self._core = event.pid, frozenset(event.core)
        elif event.event == "read":
            if event.left_out:
                left = ", ".join(dict.fromkeys(event.left_out))
                self.notes.append(f"not launched, because sim-action is the simulator: {left}")
            if event.losses and not self._allows_losses:
                raise SourceProblem(f"{'; '.join(event.losses)}; to run without it, set allow_losses: true", _KEY)
            self.losses += event.losses


def _made(folder: Path) -> Path:
    folder.mkdir()
    return folder


def variables(nodes: LaunchedNodes, port: int) -> Mapping[str, str]:
    """Return the environment variables that make a process a node of this launch."""
    wanted = ("ROS_HOSTNAME", "ROS_HOME", "ROS_PACKAGE_PATH", "ROS_ROOT")
    master = {"ROS_MASTER_URI": f"http://localhost:{port}", "ROS_LOG_DIR": str(nodes.folder / "log")}
    return {**{name: nodes.overlay.variables[name] for name in wanted}, **master}


def open_nodes(source: RosCommands, scene: Scene) -> ClosedLoop:
    """Launch the nodes of a source and return its controller. Raises SourceProblem, ScriptError."""
    if why := why_no_ros():
        raise SourceProblem(why, _KEY)
    spec, ros, port = source.ros1, find_ros(), free_port()
    workspace = workspace_of(spec.workspace, scene.workspace)
    arguments = spec.launch[2:] if spec.launch else ()
    file = _file_of(spec, workspace)
    launching = LaunchSpec(ros, workspace, file, arguments, port, scene.model.urdf, spec.allow_losses)
    try:
        nodes = LaunchedNodes(launching)
    except UsageError as error:
        # Such as messages that genpy cannot generate.
        raise SourceProblem(str(error), _KEY) from None
    try:
        node = _joined(nodes, ros, port, source, scene)
    except BaseException:
        nodes.close()
        raise
    return ClosedLoop(
        node.tick,
        sensors=node.sensors,
        close=node.close,
        notes=node.notes,
        losses=nodes.losses,
        repeats=True,
        transcript=node.transcript,
        not_reproducible=node.not_reproducible,
    )


def _file_of(spec: RosNodes, workspace: Path) -> Callable[[Overlay, Path], Path]:
    """Return a function that finds or writes the launch file, once there is an overlay."""

    def named(overlay: Overlay, folder: Path) -> Path:
        if spec.launch is None:
            (folder / "nodes.launch").write_text(launch_text(spec.nodes or ()), encoding="utf-8")
            return folder / "nodes.launch"
        package = Packages.around(workspace).folder(spec.launch[0])
        found = find_launch_file(package, spec.launch[1]) if package else None
        if package is None or found is None:
            raise SourceProblem(f"'{'/'.join(spec.launch[:2])}' does not exist any more", _KEY)
        return Path(overlay.variables["ROS_PACKAGE_PATH"]) / spec.launch[0] / found.relative_to(package)

    return named


def _joined(nodes: LaunchedNodes, ros: Ros, port: int, source: RosCommands, scene: Scene) -> RobotNode:
    """Make the simulation one more node. Raises ScriptError."""
    os.environ.update(variables(nodes, port))
    # At the end: the other packages of the distribution are for another Python.
    sys.path += [str(ros.modules), str(nodes.folder / "overlay/modules")]
    try:
        from sim_action.ros.ros1.node.robot_node import RobotNode, RobotSpec
    except ImportError as error:
        version = ".".join(map(str, sys.version_info[:3]))
        raise ScriptError(
            f"Python {version} cannot import the rospy of {ros.modules}: {error}; run sim-action with the Python that "
            f"ROS was installed for, for example in an environment made by {ros.python} -m venv"
        ) from None
    nodes.await_start()
    robot = RobotSpec(scene.model, source.rate, scene.sensors, topics_of(scene.sensors, source.ros1.topics))
    return RobotNode(nodes, robot, source.ros1.start_within)
