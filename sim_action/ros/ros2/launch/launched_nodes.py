"""The nodes that a launch file starts, and errors: from the events of the launcher, which runs in ROS's Python.

Programs of Gazebo are replaced by stand-ins, which the launcher knows by the names of the programs. Launch files also
look for packages of Gazebo: a prefix has launch files that start the stand-ins, and hides installed packages.
"""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shlex
import signal
import sys
import time
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import yaml
from typing_extensions import override

from sim_action.core.errors import ControllersFinished, ScriptError
from sim_action.core.files import content_or_empty
from sim_action.core.records import dataclass
from sim_action.core.wording import did_you_mean
from sim_action.ros.launch_events import Event, EventFile
from sim_action.ros.launches import ALLOW_LOSSES
from sim_action.ros.lost_parts import LeftOutProgram, accepted_losses, left_out_notes, lost_parts
from sim_action.ros.processes import descendants
from sim_action.ros.program_failures import error_with_output, exit_text, last_location, node_error
from sim_action.ros.ros2.lockstep import CLOCK, clock_of
from sim_action.ros.ros2.node_processes import LaunchedProcess, Node, NodeGroup
from sim_action.ros.ros2.topics import Channels

if TYPE_CHECKING:
    from sim_action.ros.ros2.node_processes import NodeProcess, ProcessFolder

_LAUNCHER: Final = Path(__file__).with_name("declared_launch.py")
# Wall time for reading a launch file and starting its processes, and for a timer that is due.
_MAX_START_S: Final = 60.0
_MAX_SHUTDOWN_S: Final = 3.0  # wall time for nodes that save something at the end
# Wall time for the part of a launch test after the shutdown.
_MAX_RESULTS_S: Final = 30.0
_POLL_S: Final = 0.005
_KEY: Final = "ros2"
_NO_MODULE: Final = re.compile(r"^ModuleNotFoundError: No module named '(launch\w*|ament_index_python)", re.MULTILINE)

_ENDS: Final = ("true",)
_STAYS: Final = ("sleep", "infinity")

FRAMES_PROGRAM: Final = "robot_state_publisher/robot_state_publisher"
"""The program that publishes the frames of links. It runs where it is installed; otherwise the robot publishes them."""

STAND_INS: Final[Mapping[str, Sequence[str]]] = {
    **dict.fromkeys(
        (
            "ros_gz_sim/create",
            "ros_gz_sim/remove",
            "ros_gz_sim/set_entity_pose",
            "ros_ign_gazebo/create",
            "gazebo_ros/spawn_entity.py",
            "controller_manager/spawner",
            "controller_manager/spawner.py",
            "controller_manager/unspawner",
        ),
        _ENDS,
    ),
    **dict.fromkeys(
        (
            *("ros_gz_sim", "ros_gz_bridge", "ros_gz_image", "ros_gz_point_cloud"),
            *("ros_ign_gazebo", "ros_ign_bridge", "ros_ign_image"),
            *("gazebo_ros", "controller_manager", "rviz2", "joint_state_publisher_gui", "joint_state_publisher"),
            *("gz", "ign", "gazebo", "gzserver", "gzclient", "rviz2", "rqt"),
            FRAMES_PROGRAM,
        ),
        _STAYS,
    ),
}
"""PACKAGE/PROGRAM, a package or a program -> the command that runs instead.

A program that ends by itself does so at once, because event handlers wait for its end. The others do nothing until the
launch is over.
"""

_PARAMETER_FILES: Final = frozenset({"-p", "--param-file"})
_MAX_PARAMETER_BYTES: Final = 1_000_000
_JOINT_STATES: Final = "joint_state_broadcaster"
_INDEX: Final = "share/ament_index/resource_index/packages"

# Package -> launch file -> command; {NAME} is the value of an argument of the launch file.
_SERVER: Final = ("gz", "sim", "{gz_args}", "{ign_args}")
_WORLD: Final = ("gz", "sim", "{world_sdf_file}")
_SPAWNED: Final = ("ros_gz_sim/create", "-name", "{entity_name}", "-topic", "{topic}", "-file", "{file}")
_CLASSIC: Final = ("gazebo", "{world}")
_LAUNCH_FILES: Final[Mapping[str, Mapping[str, tuple[str, ...]]]] = {
    "ros_gz_sim": {
        "gz_sim.launch.py": _SERVER,
        "gz_server.launch.py": _WORLD,
        "ros_gz_sim.launch.py": _WORLD,
        "gz_spawn_model.launch.py": _SPAWNED,
    },
    "ros_gz_bridge": {"ros_gz_bridge.launch.py": ("ros_gz_bridge/parameter_bridge",)},
    "ros_gz_image": {},
    "ros_ign_gazebo": {"ign_gazebo.launch.py": _SERVER},
    "ros_ign_bridge": {},
    "gazebo_ros": dict.fromkeys(("gazebo.launch.py", "gzserver.launch.py"), _CLASSIC)
    | {"gzclient.launch.py": ("gzclient",)},
}

_TEXT: Final = """\
from launch import LaunchDescription
from launch.actions import ExecuteProcess
from launch.substitutions import LaunchConfiguration


def _word(word):
    return LaunchConfiguration(word[1:-1], default="") if word.startswith("{{") else word


def generate_launch_description():
    return LaunchDescription([ExecuteProcess(cmd=[_word(word) for word in {words!r}])])
"""


@dataclass(frozen=True, slots=True)
class LaunchSpec:
    """The input of a launch; `results`: file of results of a launch test, which name `package`; None: a launch file."""

    file: Path
    python: Path
    arguments: Sequence[str]
    workspace: Path
    topics: Channels = Channels()
    allows_losses: bool = False
    results: Path | None = None
    package: str = ""


class LaunchedNodes(NodeGroup):
    """All processes of a launch; `topics`: the topics of the robot, which a launch test spawns after the start."""

    def __init__(self, spec: LaunchSpec, folder: ProcessFolder) -> None:
        """Start the launcher, and return at once. Raise ScriptError."""
        self._spec = spec
        self.topics = spec.topics
        self._events = EventFile(folder.path / "events")
        self._times = folder.path / "times"
        os.mkfifo(self._times)
        self._writer = os.open(self._times, os.O_RDWR | os.O_CLOEXEC)
        self._launcher = self._start(folder)
        self._timers: list[float] = []
        self._calm_at = -1.0
        self._has_finished = False
        self._left_out: list[LeftOutProgram] = []
        self._new: list[tuple[tuple[str, ...], Node]] = []
        self._processes: dict[int, LaunchedProcess] = {}
        super().__init__([self._launcher.pid])

    def _start(self, folder: ProcessFolder) -> NodeProcess:
        ament_prefixes = folder.environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
        has_frames = any(Path(path, "lib", FRAMES_PROGRAM).exists() for path in ament_prefixes if path)
        left_out = {key: list(command) for key, command in STAND_INS.items() if key != FRAMES_PROGRAM or not has_frames}
        task: dict[str, Any] = {
            "events": str(folder.path / "events"),
            "times": str(self._times),
            "file": str(self._spec.file),
            "arguments": list(self._spec.arguments),
            "clock": clock_of("{}"),
            "stand_ins": left_out,
            "results": str(self._spec.results or ""),
            "package": self._spec.package,
        }
        path = folder.path / "task.json"
        path.write_text(json.dumps(task), encoding="utf-8")
        prefixes = (str(write_prefix(folder.path / "gazebo")), folder.environment.get("AMENT_PREFIX_PATH", ""))
        folder.environment["AMENT_PREFIX_PATH"] = os.pathsep.join(filter(None, prefixes))
        # Last: a real one counts.
        for name, own in zip(("PATH", "PYTHONPATH"), _write_xacro(folder.path), strict=True):
            folder.environment[name] = os.pathsep.join(filter(None, (folder.environment.get(name, ""), str(own))))
        # All output of nodes, wherever the launch file sends it.
        folder.environment["OVERRIDE_LAUNCH_PROCESS_OUTPUT"] = "both"
        return folder.start("ros2 launch", [str(self._spec.python), str(_LAUNCHER), str(path)])

    @override
    def await_start(self) -> None:
        self.await_programs()
        losses = lost_parts(self._left_out, partial(lost_controller, command_topics=self.topics.commands))
        remedy = "set allow_losses: true" if self._spec.results is None else f"use {ALLOW_LOSSES}"
        self.losses += accepted_losses(losses, _KEY, allowed=self._spec.allows_losses, remedy=remedy)
        self.notes += left_out_notes(self._left_out)
        self.notes += unheard_bridges(self._left_out, self.topics.published | {CLOCK})

    def await_programs(self) -> list[LeftOutProgram]:
        """Wait until all processes are started; return the programs that are left out. Raise ScriptError."""
        self._await_calm(0.0)
        return list(self._left_out)

    @override
    def tell_time(self, seconds: float) -> None:
        if not any(due <= seconds for due in self._timers):
            return
        self._timers = [due for due in self._timers if due > seconds]
        os.write(self._writer, b"%r\n" % seconds)
        self._await_calm(seconds)

    @override
    def new_nodes(self) -> list[Node]:
        self.refuse_ended()
        # In the order of the names of nodes and programs.
        entries = sorted(self._new, key=lambda entry: entry[0])
        self._new = []
        return [node for _, node in entries]

    @override
    def refuse_ended(self) -> None:
        code = self._launcher.exit_code()
        for event in self._events.new():
            self._take(event)
        if code is not None and self._spec.results:
            raise ControllersFinished("the test has finished")
        if code is not None:
            raise end_error(code, self._launcher.text())

    @override
    def close(self) -> None:
        if self._has_finished:
            # It has still to write its results.
            self._launcher.await_end(_MAX_RESULTS_S)
        # A node may have left the process group that the folder ends.
        processes = descendants(self._launcher.pid)
        self._launcher.signal_group(signal.SIGINT)
        self._launcher.await_end(_MAX_SHUTDOWN_S)
        for pid in processes:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self._events.close()
        os.close(self._writer)

    def _await_calm(self, seconds: float) -> None:
        deadline = time.monotonic() + _MAX_START_S
        while self._calm_at < seconds:
            self.refuse_ended()
            if time.monotonic() > deadline:
                error = f"the processes of the launch file were not started within {_MAX_START_S:g} s of wall time"
                raise ScriptError(error, details=self._launcher.text())
            time.sleep(_POLL_S)

    def _take(self, event: Event) -> None:
        """Handle an event. Raise ScriptError."""
        self._refuse(event)
        if event.event == "calm":
            self._calm_at = event.time
        elif event.event == "timer":
            self._timers.append(event.time)
        elif event.event == "left out":
            self._left_out.append(LeftOutProgram(event.program, event.args))
        elif event.event == "died" and event.pid in self._processes:
            self._processes[event.pid].code = event.exit_code
        elif event.clock is not None:
            process = LaunchedProcess(event.process or event.node or event.program, event.pid, self.refuse_ended)
            if event.pid:
                self._processes[event.pid] = process
            order = (event.node, Path(event.program).name, event.process)
            self._new.append((order, Node(event.clock, process)))
        elif event.event == "process" and not any(left_out.program == event.program for left_out in self._left_out):
            self.notes.append(
                f"the process '{event.process}' of the launch file is no node for launch: it gets no clock of its own, "
                "and use_sim_time is not set for it"
            )

    def _refuse(self, event: Event) -> None:
        """Raise ScriptError for an event that ends the run; ControllersFinished at the end of a launch test."""
        output = self._launcher.text()
        if event.event == "refused":
            raise refusal_error(event, output, self._spec.workspace)
        if event.event == "shutdown" and self._spec.results is None:
            raise error_with_output(f"the launch file ended the launch during the run: {event.message}", output)
        if event.event == "shutdown":
            self._has_finished = True
            raise ControllersFinished("the test has finished")
        # A launch test judges the exit codes of its processes itself.
        if event.event == "died" and event.exit_code and self._spec.results is None:
            node, text = f"the node '{event.process}' of the launch file", text_of(event.process, output)
            raise node_error(node, event.exit_code, f"{text}\n", self._spec.workspace)


def refusal_error(event: Event, output: str, workspace: Path) -> ScriptError:
    """Return the error for a launch file that cannot be run as it is written, at its place in the user's code."""
    why = f"the launch file cannot be run: {_why_refused(event)}"
    return error_with_output(why, output, last_location(event.places, workspace))


def end_error(exit_code: int, output: str) -> ScriptError:
    """Return the error for a launcher that ended without an event."""
    why = f"the launcher ended with {exit_text(exit_code)}, and its nodes ended with it"
    if missing := _NO_MODULE.search(output):
        why = (
            f"launch files need the Python package '{missing[1]}' of ROS 2, which this ROS 2 lacks (the wheels on PyPI "
            "have none): use ROS 2 of /opt/ros or RoboStack, or list the nodes under 'nodes'"
        )
    return error_with_output(why, output)


def lost_controller(name: str, program: LeftOutProgram, command_topics: Collection[str]) -> str | None:
    """Return why a controller is lost for a robot with these command topics; None if it is replaced."""
    kind = dict(_types(program.args)).get(name, "")
    is_replaced = name == _JOINT_STATES or kind.startswith(f"{_JOINT_STATES}/")
    if is_replaced or any(topic.startswith(f"/{name}/") for topic in command_topics):
        return None
    stated = f"'{name}' ({kind})" if kind else f"'{name}'"
    where = f"the robot takes no commands on /{name}/...: name its topic in 'topics'"
    return f"the controller {stated} does not run, and {where}"


def _types(args: Sequence[str]) -> Iterator[tuple[str, str]]:
    for option, value in pairwise(args):
        if option in _PARAMETER_FILES:
            yield from _types_in(_parameters(Path(value)), "")


def _types_in(value: Any, name: str) -> Iterator[tuple[str, str]]:
    if not isinstance(value, dict):
        return
    if isinstance(value.get("type"), str):
        yield name, value["type"]
    for key, child in value.items():
        yield from _types_in(child, name if key == "ros__parameters" else str(key).rpartition("/")[2])


def _parameters(path: Path) -> Any:
    try:
        return yaml.safe_load(content_or_empty(path, _MAX_PARAMETER_BYTES))
    except (yaml.YAMLError, UnicodeDecodeError):
        return None


def unheard_bridges(programs: Iterable[LeftOutProgram], topics: Collection[str]) -> Iterator[str]:
    """Yield a note for each topic that a bridge would carry to ROS 2 and the robot does not publish."""
    for program in programs:
        if program.program.rpartition("/")[2] != "parameter_bridge":
            continue
        remapped = dict(
            value.split(":=", 1) for option, value in pairwise(program.args) if option == "-r" and ":=" in value
        )
        for argument in program.args:
            topic, at, rest = argument.partition("@")
            name = remapped.get(topic, topic)
            if at and "[" in rest and f"/{name.lstrip('/')}" not in topics:
                yield f"the launch file bridges {name} to ROS 2, and the robot does not publish it"


def write_prefix(folder: Path) -> Path:
    """Write the prefix into a folder that does not exist, and return it."""
    index = folder / _INDEX
    index.mkdir(parents=True)
    for package, files in _LAUNCH_FILES.items():
        (index / package).touch()
        launch = folder / "share" / package / "launch"
        launch.mkdir(parents=True)
        for name, words in files.items():
            (launch / name).write_text(_TEXT.format(words=words), encoding="utf-8")
    return folder


def _write_xacro(folder: Path) -> tuple[Path, Path]:
    """Write a program and a module `xacro`, which many launch files use, and return the folder of each."""
    programs = folder / "programs"
    programs.mkdir()
    path, root = programs / "xacro", shlex.quote(str(Path(__file__).parents[4]))
    own = f"exec env -u LD_LIBRARY_PATH PYTHONPATH={root} {shlex.quote(sys.executable)}"
    path.write_text(f'#!/bin/sh\n{own} -m sim_action.ros.xacro "$@"\n', encoding="utf-8")
    path.chmod(0o755)
    modules = folder / "modules"
    modules.mkdir()
    if (spec := importlib.util.find_spec("xacro")) is not None and spec.origin:
        (modules / "xacro").symlink_to(Path(spec.origin).parent)
    return programs, modules


def text_of(process: str, output: str) -> str:
    """Return the lines that one process has printed."""
    prefix = f"[{process}] "
    return "\n".join(line.removeprefix(prefix) for line in output.splitlines() if line.startswith(prefix))


def _why_refused(event: Event) -> str:
    # The first quoted word of the message is the package.
    is_message = event.kind == "PackageNotFoundError"
    name = event.message.partition("'")[2].partition("'")[0] if is_message else event.name
    near = did_you_mean(name, event.names)
    if event.kind == "package" or is_message:
        fix = "add it to the workspace, or use a ROS 2 that has it, such as ros:jazzy"
        return f"there is no package '{name}' in the workspace or ROS 2{near}; {fix}"
    if event.kind == "program":
        return f"the package '{event.package}' has no executable '{event.name}'{near}"
    if event.kind == "argument":
        return f"it has no argument '{event.name}'{near}"
    if event.kind == "start":
        return f"'{event.name}' cannot be started: {event.message}"
    if event.kind == "unsupported":
        lacks = "which this ROS 2 lacks (the wheels on PyPI have none)"
        return f"{event.message} needs the Python package 'launch', {lacks}: use ROS 2 of /opt/ros or RoboStack"
    return f"{event.kind}: {event.message.partition(chr(10))[0]}"
