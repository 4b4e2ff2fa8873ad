"""The controller of a scenario that nodes of ROS 1 drive: it launches them, and joins them as one more node.

A scenario replaces most nodes of Gazebo in a launch file; the others are losses. The scenario is the robot, the world
and the drive. Further models, other worlds and controllers of joints are missing.
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from functools import partial
from os import path
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from xml.etree import ElementTree as ET

import yaml

from sim_action.commands import ClosedLoop
from sim_action.commands.line_protocol import StderrTail
from sim_action.core.errors import ScriptError, SourceProblem, UsageError
from sim_action.core.wording import did_you_mean
from sim_action.ros import node_start
from sim_action.ros.launch_events import Event, EventFile
from sim_action.ros.lost_parts import LeftOutProgram, accepted_losses, left_out_notes, lost_parts
from sim_action.ros.processes import children
from sim_action.ros.program_failures import error_with_output, signal_name, traceback_location
from sim_action.ros.ros1.catkin_packages import find_launch_file, workspace_of
from sim_action.ros.ros1.command_source.file_problems import Packages, local_ros
from sim_action.ros.ros1.installation import Ros
from sim_action.ros.ros1.launch.launch_process import Launch, free_port
from sim_action.ros.ros1.launch.overlay import build_overlay, scratch_parent
from sim_action.ros.ros1.verdicts.launch_output import (
    Death,
    callback_errors,
    cleaned_output,
    last_exception,
    refusal,
    xacro_error,
)
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.ros.ros1.command_source.spec import NodeSpec, RosNodes
    from sim_action.ros.ros1.node.robot_node import RobotNode

_LAUNCHER: Final = Path(__file__).with_name("launcher.py")
# Packages whose nodes would wait forever for Gazebo, or for controllers of its plugins. The robot of the scenario
# publishes the states of its joints.
_LEFT_OUT: Final = ("gazebo_ros", "controller_manager", "joint_state_publisher", "joint_state_publisher_gui")
_STANDARD_OUTPUT: Final = 1
_MAX_KEPT_BYTES: Final = 100_000
_POLL_S: Final = 0.005
# Wall time for reading and starting a launch file, for roslaunch to notice ended nodes, and for nodes to leave.
_MAX_START_S: Final = 60.0
_MAX_NOTICE_S: Final = 20.0
_MAX_SHUTDOWN_S: Final = 5.0
KEY: Final = "ros1"

REPLACED_CONTROLLERS: Final[Mapping[str, str]] = {
    "joint_state_controller/JointStateController": "the robot publishes joint_states",
    "diff_drive_controller/DiffDriveController": "the drive of the scenario follows the twists",
}
"""Type of a controller -> the reason why its absence is not a loss."""

_NOT_FOUND: Final = "ResourceNotFound"  # the exception of roslaunch for a missing package


class LaunchedNodes:
    """All nodes of a scenario, without the simulation; `port`: of their master."""

    def __init__(self, spec: RosNodes, scene: Scene, ros: Ros, port: int) -> None:
        """Launch the nodes, and return at once. Raises UsageError, SourceProblem."""
        self._spec, self.ros, self.port = spec, ros, port
        self._workspace = workspace_of(spec.workspace, scene.workspace)
        with ExitStack() as undo:
            self.folder = Path(path.realpath(tempfile.mkdtemp(prefix="sim-action-", dir=scratch_parent())))
            undo.callback(shutil.rmtree, self.folder, ignore_errors=True)
            self._logs = self.folder / "log"
            self.overlay = build_overlay(self.folder / "overlay", ros, self._workspace, os.environ)
            self._events = EventFile(self.folder / "events")
            undo.callback(self._events.close)
            self._launch = self._start(scene)
            undo.callback(self._launch.close)
            self._closing = undo.pop_all()
        self._words = StderrTail(self._launch.output_stream, _STANDARD_OUTPUT, _MAX_KEPT_BYTES)
        self._exited: set[int] = set()
        self.launcher = 0
        self._core = frozenset[int]()
        self._left_out: list[LeftOutProgram] = []
        self.notes: list[str] = []
        self.losses: list[str] = []

    def _start(self, scene: Scene) -> Launch:
        task: dict[str, Any] = {
            "events": str(self.folder / "events"),
            "file": str(self._file()),
            "arguments": list(self._spec.launch[2:] if self._spec.launch else ()),
            "port": self.port,
            "left_out": _LEFT_OUT,
            "defaults": {"/robot_description": scene.model.urdf} if scene.model.urdf else {},
            "params": {"/use_sim_time": True},
        }
        (self.folder / "task.json").write_text(json.dumps(task), encoding="utf-8")
        words = [str(self.ros.python), "-c", _LAUNCHER.read_text(encoding="utf-8"), str(self.folder / "task.json")]
        call = self.folder / "call"
        call.mkdir()
        more = {**self._of_master(), **node_start.variables(scene.seed)}
        return Launch.start(words, self.overlay, call, more, captures_output=True)

    def _file(self) -> Path:
        """Return the launch file in the overlay, or write one for the listed nodes. Raises SourceProblem."""
        launch, own = self._spec.launch, self.folder / "nodes.launch"
        if launch is None:
            own.write_text(launch_text(self._spec.nodes or ()), encoding="utf-8")
            return own
        package = Packages.around(self._workspace).folder(launch[0])
        file = find_launch_file(package, launch[1]) if package else None
        if package is None or file is None:
            raise SourceProblem(f"'{'/'.join(launch[:2])}' does not exist any more", KEY)
        return Path(self.overlay.variables["ROS_PACKAGE_PATH"]) / launch[0] / file.relative_to(package)

    def _of_master(self) -> dict[str, str]:
        return {"ROS_MASTER_URI": f"http://localhost:{self.port}", "ROS_LOG_DIR": str(self._logs)}

    @property
    def variables(self) -> dict[str, str]:
        """The environment variables that make a process a node of this launch."""
        names = ("ROS_HOSTNAME", "ROS_HOME", "ROS_PACKAGE_PATH", "ROS_ROOT")
        return {**{name: self.overlay.variables[name] for name in names}, **self._of_master()}

    def await_start(self) -> None:
        """Wait until all nodes are started. Raises ScriptError."""
        self._wait(lambda: self.launcher != 0, _MAX_START_S, "the nodes were not started")

    def await_exits(self, pids: Iterable[int]) -> None:
        """Wait until the exit codes of these processes are known. Raises ScriptError for a failed one."""
        awaited = set(pids)
        self._wait(lambda: awaited <= self._exited, _MAX_NOTICE_S, "")

    def _look(self) -> None:
        for event in self._events.new():
            if is_failure(event):
                raise self._failure(event)
            if event.event == "died":
                self._exited.add(event.pid)
            elif event.event == "started":
                self.launcher, self._core = event.pid, frozenset(event.core)
            elif event.event == "left out":
                self._left_out.append(LeftOutProgram(event.program, tuple(words_of(*event.args))))
            elif event.event == "read":
                self.notes += left_out_notes(self._left_out)
                types = dict(text.split("=", 1) for text in event.types)
                losses = lost_parts(self._left_out, partial(lost_controller, types=types), [event.world])
                self.losses += accepted_losses(losses, KEY, allowed=self._spec.allow_losses)

    def end_error(self) -> ScriptError:
        """Return the error for a launcher that ended without an event, or a master that does not answer any more."""
        code = self._launch.poll()
        how = f" by {signal_name(-code)}" if code is not None and code < 0 else ""
        return self._error(f"roslaunch ended{how} during the run, and its nodes ended with it")

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
                raise self.end_error()
            if time.monotonic() > deadline:
                if what:
                    raise self._error(f"{what} within {seconds:g} s of wall time")
                return
            time.sleep(_POLL_S)

    def _failure(self, event: Event) -> ScriptError:
        """Return the error for a node that has ended, or for a launch file that was refused."""
        if event.event == "refused":
            # The launcher is about to leave: its output is complete after that.
            self._words.close()
            return self._error(f"nothing was launched: {self._why_refused(event)}")
        if not event.exit_code:
            return self._error(f"the node '{event.node}' finished during the run, and it is required")
        text = cleaned_output(self._words.all())
        said = last_exception(text, event.program)
        death = Death(event.node, event.exit_code, event.program)
        error = self._error(f"{death}{'; it is required' if event.required else ''}{f': {said}' if said else ''}")
        error.location = traceback_location(_after_mention(text, event.program), self._workspace) if said else None
        return error

    def _why_refused(self, event: Event) -> str:
        if event.kind == _NOT_FOUND:
            name = event.message.partition("\n")[0].strip()
            near = did_you_mean(name, self.overlay.packages)
            return f"it needs the package '{name}', which is neither in the workspace nor in ROS{near}"
        text = self._shown(cleaned_output(self._words.all()))
        return xacro_error(text) or refusal(text) or event.message.strip().partition("\n")[0] or event.kind

    def _shown(self, text: str) -> str:
        return text.replace(f"{self.overlay.variables['ROS_PACKAGE_PATH']}/", "")

    def _error(self, message: str) -> ScriptError:
        return error_with_output(self._shown(message), self._shown(cleaned_output(self._words.all())))


def lost_controller(name: str, _: LeftOutProgram, types: Mapping[str, str]) -> str | None:
    """Return why a controller is lost; None if the scenario replaces it. `types`: of controllers, by name."""
    if (kind := types.get(name, "")) in REPLACED_CONTROLLERS:
        return None
    return f"the controller '{name}' ({kind or 'without a type'}) does not run: drive joints with other commands"


def words_of(args: str) -> list[str]:
    """Return the words of the arguments of a node."""
    try:
        return shlex.split(args)
    except ValueError:
        return args.split()


def is_failure(event: Event) -> bool:
    """Return True if an event ends the run with an error."""
    return event.event == "refused" or (event.event == "died" and (event.required or event.exit_code != 0))


def _after_mention(text: str, program: str) -> str:
    start = text.rfind("Traceback (most recent call last)", 0, max(0, text.rfind(f'/{Path(program).name}", line ')))
    return text[start:] if start >= 0 else text


def open_nodes(spec: RosNodes, rate: float, scene: Scene) -> ClosedLoop:
    """Launch nodes, and return their controller; `rate`: ticks per second. Raises SourceProblem, ScriptError."""
    ros, why = local_ros()
    if ros is None:
        raise SourceProblem(str(why), KEY)
    try:
        nodes = LaunchedNodes(spec, scene, ros, free_port())
    except UsageError as error:
        # Such as messages that genpy cannot generate.
        raise SourceProblem(str(error), KEY) from None
    try:
        node = _joined(nodes, spec, rate, scene)
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


def _joined(nodes: LaunchedNodes, spec: RosNodes, rate: float, scene: Scene) -> RobotNode:
    """Make the simulation one more node. Raises ScriptError."""
    os.environ.update(nodes.variables)
    ros = nodes.ros
    # At the end: the other packages of the distribution are for another Python.
    sys.path += [str(ros.modules), str(nodes.folder / "overlay/modules")]
    try:
        from sim_action.ros.ros1.node.robot_node import RobotNode  # the rest of the module runs without it
    except ImportError as error:
        version = ".".join(map(str, sys.version_info[:3]))
        raise ScriptError(
            f"Python {version} cannot import the rospy of {ros.modules}: {error}; run sim-action with the Python that "
            f"ROS was installed for, for example in an environment made by {ros.python} -m venv"
        ) from None
    nodes.await_start()
    return RobotNode(nodes, scene, spec, rate)


def launch_text(nodes: Iterable[NodeSpec]) -> str:
    """Return the text of a launch file that starts the nodes (wiki.ros.org/roslaunch/XML)."""
    launch = ET.Element("launch")
    for node in nodes:
        element = ET.SubElement(launch, "node", pkg=node.package, type=node.type, name=node.called)
        if node.args:
            element.set("args", node.args)
        if node.namespace:
            element.set("ns", node.namespace)
        if node.required:
            element.set("required", "true")
        for name, other in node.remap.items():
            # `from` is a keyword of Python.
            ET.SubElement(element, "remap", {"from": name, "to": other})
        if node.params:
            # roslaunch reads it with the same library. JSON would not do: its 1e-6 is text in YAML 1.1.
            ET.SubElement(element, "rosparam").text = yaml.safe_dump(node.params)
    ET.indent(launch)
    return ET.tostring(launch, encoding="unicode") + "\n"
