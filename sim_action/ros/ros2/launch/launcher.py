"""The launcher: the real LaunchService or launch_testing in ROS's Python, with events as lines of JSON.

declared_launch.py runs it where `launch` is installed, on the Python of ROS, which may be an old one; only modules of
this folder are imported. Every process of a launch is prepared by one method of `launch`, wherever its action stands:
in an included file, a group, an event handler, XML or YAML. There each node gets its own clock and sim time.
"""

from __future__ import annotations

import asyncio
import functools
import json
import os
import signal
import sys
from pathlib import Path
from typing import Any

import launch.actions.execute_local
from ament_index_python.packages import PackageNotFoundError, get_packages_with_prefixes
from launch import LaunchDescription, LaunchService
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, TimerAction
from launch.event_handlers import OnProcessExit, OnShutdown
from launch.launch_description_sources import AnyLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch.utilities import perform_substitutions, type_utils
from launch_ros.actions import Node, ROSTimer
from launch_ros.substitutions import ExecutableInPackage

from sim_action.ros.ros2.launch.declared_table import LaunchError, event_writer, stand_in_of

# The times in s that a node may take to leave after SIGINT, and after SIGTERM.
_TIMEOUTS = {"sigterm_timeout": "2", "sigkill_timeout": "0.5"}
_SHELL_OPERATORS = frozenset(";|&<>$`(")
_READ_BYTES = 65536


class _SimTime:
    """Sim time, which arrives as lines of text in a FIFO; `answer` is called after each arrival."""

    def __init__(self, path: str, answer: Any) -> None:
        # Also open for writing: there is no end of the file while the simulation has not opened it yet.
        self._descriptor = os.open(path, os.O_RDWR | os.O_NONBLOCK)
        self._answer = answer
        self._waiting: list[tuple[float, asyncio.Future[None]]] = []
        self._unread = b""
        self._is_read = False
        self.now = 0.0

    def read_in(self, loop: asyncio.AbstractEventLoop) -> None:
        """Read the FIFO in a loop."""
        if not self._is_read:
            loop.add_reader(self._descriptor, self._read)
            self._is_read = True

    def future(self, due: float, loop: asyncio.AbstractEventLoop) -> asyncio.Future[None]:
        """Return a future that is done at a sim time."""
        waiter: asyncio.Future[None] = loop.create_future()
        self._waiting.append((due, waiter))
        return waiter

    def _read(self) -> None:
        *lines, self._unread = (self._unread + os.read(self._descriptor, _READ_BYTES)).split(b"\n")
        self.now = max(self.now, *map(float, lines)) if lines else self.now
        due = sorted((pair for pair in self._waiting if pair[0] <= self.now), key=lambda pair: pair[0])
        self._waiting = [pair for pair in self._waiting if pair[0] > self.now]
        fired = [waiter for _, waiter in due if not waiter.done()]
        for waiter in fired:
            waiter.set_result(None)
        if lines:
            self._answer(len(fired))


class _Launcher:
    """Changes `launch` in this process, and reports what happens."""

    def __init__(self, task: dict[str, Any]) -> None:
        self._task, self._tell = task, event_writer(task)
        self._left_out = frozenset(key.partition("/")[0] for key in task["stand_ins"])
        self._time = _SimTime(task["times"], self._answer_time)
        self._clocks = self._firing = 0
        self._owes_calm = True
        self._has_started = False
        # Commands of processes with their roles, and commands of processes that are about to start.
        self._roles: list[tuple[list[str], dict[str, Any]]] = []
        self._starting: list[list[str]] = []
        # The arguments that launch files declare, and the names that they read.
        self._declared: set[str] = set()
        self._read: set[str] = set()
        self._context: Any = None

    def install(self) -> None:
        """Wrap the functions of `launch` through which every process, timer and event goes."""
        _wrap(LaunchService, "__init__", self._make_service)
        _wrap(LaunchService, "_process_one_event", self._process_one_event)
        execute_local = launch.actions.execute_local
        _wrap(execute_local.ExecuteLocal, "prepare", self._prepare)
        _wrap(execute_local, "async_execute_process", self._start_process)
        _wrap(ExecutableInPackage, "perform", self._find_program)
        _wrap(DeclareLaunchArgument, "execute", self._declare)
        _wrap(LaunchConfiguration, "perform", self._read_configuration)
        for timer in (TimerAction, ROSTimer):
            _wrap(timer, "_wait_to_fire_event", self._wait_for_timer)
        try:
            from launch_ros.actions import load_composable_nodes
        except ImportError:
            # Without composition_interfaces there are no containers.
            return
        _wrap(load_composable_nodes, "get_composable_node_load_request", self._load_request)

    def _make_service(self, original: Any, service: Any, **words: Any) -> None:
        original(service, **words)
        self._context = service.context
        self._context.launch_configurations.update(_TIMEOUTS)
        self._context.register_event_handler(OnProcessExit(on_exit=self._tell_exit))
        self._context.register_event_handler(OnShutdown(on_shutdown=self._tell_shutdown))

    async def _process_one_event(self, original: Any, service: Any) -> None:
        self._time.read_in(asyncio.get_running_loop())
        try:
            await original(service)
        except Exception as error:
            self._tell("refused", **_explained(error))
            raise
        self._tell_if_calm()

    def _tell_if_calm(self) -> None:
        """Report that all actions so far are done, and their processes started."""
        if not self._owes_calm or self._starting or self._firing or not self._context._event_queue.empty():  # noqa: SLF001 - launch has no other way
            return
        self._owes_calm = False
        # A launch test reads its arguments by itself, too.
        is_checked = not self._has_started and not self._task["results"]
        names = {argument.partition(":=")[0] for argument in self._task["arguments"]}
        unknown = sorted(names - self._declared - self._read) if is_checked else []
        self._has_started = True
        if unknown:
            self._tell("refused", kind="argument", name=unknown[0], names=sorted(self._declared))
        self._tell("calm", time=self._time.now, pid=os.getpid())

    def _answer_time(self, fired: int) -> None:
        self._firing += fired
        self._owes_calm = True
        self._tell_if_calm()

    async def _wait_for_timer(self, original: Any, action: Any, context: Any) -> None:
        """Wait for sim time, except in timers of `launch` that end processes."""
        if not _cancels_on_shutdown(action, context):
            await original(action, context)
            return
        period = type_utils.perform_typed_substitution(context, action.period, float)
        due = self._time.now + period
        waiter = self._time.future(due, context.asyncio_loop)
        self._tell("timer", time=due)
        await asyncio.wait([action._canceled_future, waiter], return_when=asyncio.FIRST_COMPLETED)  # noqa: SLF001 - as launch does it
        if not action._canceled_future.done():  # noqa: SLF001 - likewise
            await context.emit_event(launch.events.TimerEvent(timer_action=action))
        if waiter.done():
            self._firing -= 1
        action._completed_future.set_result(None)  # noqa: SLF001 - likewise

    def _declare(self, original: Any, action: Any, context: Any) -> Any:
        self._declared.add(action.name)
        return original(action, context)

    def _read_configuration(self, original: Any, substitution: Any, context: Any) -> Any:
        self._read.add(perform_substitutions(context, substitution.variable_name))
        return original(substitution, context)

    def _find_program(self, original: Any, substitution: Any, context: Any) -> Any:
        """Return the path of a program. Programs that are left out need not be installed."""
        package = perform_substitutions(context, substitution.package)
        program = perform_substitutions(context, substitution.executable)
        if package in self._left_out:
            return f"{package}/{program}"
        try:
            return original(substitution, context)
        except PackageNotFoundError:
            self._tell("refused", kind="package", name=package, names=sorted(get_packages_with_prefixes()))
            raise
        except Exception as error:
            folder = Path(get_packages_with_prefixes()[package]) / "lib" / package
            names = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
            more = {"kind": "program", "package": package, "name": program, "names": names}
            self._tell("refused", **{**_explained(error), **more})
            raise

    def _prepare(self, original: Any, action: Any, context: Any) -> None:
        """Give a node its clock and sim time, or put its stand-in in the place of a program of Gazebo."""
        original(action, context)
        details = action.process_details
        command: list[str] = details["cmd"]
        words = [word for word in command if word.strip()]
        role = {"process": details["name"], "program": words[0], "node": _full_name(action)}
        stand_in = stand_in_of(self._task["stand_ins"], words[0])
        if stand_in is not None:
            self._tell("left out", **role, args=words[1:])
            command[:] = stand_in
        elif isinstance(action, Node) or _is_ros2_run(action, words):
            role["clock"] = self._clocks
            command += ["--ros-args", "-r", self._next_clock(), "-p", "use_sim_time:=true"]
        self._roles.append((command, role))
        self._starting.append(command)

    def _next_clock(self) -> str:
        topic = self._task["clock"].format(self._clocks)
        self._clocks += 1
        return f"/clock:={topic}"

    def _load_request(self, original: Any, description: Any, context: Any) -> Any:
        """Give a node in a container its clock: it does not take the arguments of the process."""
        request = original(description, context)
        if request is None:
            return None
        from rclpy.parameter import Parameter

        number = self._clocks
        parameter = Parameter("use_sim_time", Parameter.Type.BOOL, True)
        request.remap_rules = [self._next_clock(), *request.remap_rules]
        others = [other for other in request.parameters if other.name != "use_sim_time"]
        request.parameters = [*others, parameter.to_parameter_msg()]
        self._tell("composed", node=request.node_name, program=request.plugin_name, clock=number)
        return request

    async def _start_process(self, original: Any, *args: Any, **words: Any) -> Any:
        """Start a process and report its id, or why it does not start, which `launch` only logs."""
        command = words["cmd"]
        role = next((role for other, role in self._roles if other is command), {})
        try:
            transport, protocol = await original(*args, **words)
        except Exception as error:
            message = (isinstance(error, OSError) and error.strerror) or str(error)
            self._tell("refused", kind="start", name=command[0], message=message)
            raise
        finally:
            self._starting = [other for other in self._starting if other is not command]
        self._tell("process", **role, pid=transport.get_pid())
        asyncio.get_running_loop().call_soon(self._tell_if_calm)
        return transport, protocol

    def _tell_exit(self, event: Any, context: Any) -> None:
        if not context.is_shutdown:
            self._tell("died", process=event.process_name, pid=event.pid, exit_code=event.returncode)

    def _tell_shutdown(self, event: Any, _context: Any) -> None:
        self._tell("shutdown", message=str(event.reason))


def _wrap(owner: Any, name: str, function: Any) -> None:
    """Replace a function or method; `function` takes the original first."""
    original = getattr(owner, name)

    @functools.wraps(original)
    def wrapped(*args: Any, **words: Any) -> Any:
        return function(original, *args, **words)

    setattr(owner, name, wrapped)


def _cancels_on_shutdown(action: Any, context: Any) -> bool:
    stated = getattr(action, "_TimerAction__cancel_on_shutdown", True)
    return bool(type_utils.perform_typed_substitution(context, stated, bool))


def _full_name(action: Any) -> str:
    """Return the full name of a node, as far as its launch file names it; else nothing."""
    name = action.node_name if isinstance(action, Node) else Node.UNSPECIFIED_NODE_NAME
    return "" if Node.UNSPECIFIED_NODE_NAME in name else name.replace(Node.UNSPECIFIED_NODE_NAMESPACE, "")


def _is_ros2_run(action: Any, words: list[str]) -> bool:
    """Return True for a plain `ros2 run`, which passes arguments on to its program."""
    is_plain = not (action.shell and _SHELL_OPERATORS & set(" ".join(words)))
    return is_plain and [Path(words[0]).name, *words[1:2]] == ["ros2", "run"]


def _explained(error: BaseException) -> dict[str, Any]:
    """Return the kind of an exception, its message, and the places in files that led to it, the last one last."""
    refusal = LaunchError.of(error)
    return {**refusal.event, "places": refusal.places}


def main(path: str) -> int:
    """Launch, and return the exit code."""
    # Programs inherit a signal that is ignored, and would not end by it.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    task = json.loads(Path(path).read_text(encoding="utf-8"))
    _Launcher(task).install()
    if task["results"]:
        from launch_testing import launch_test

        names = ["--package-name", task["package"], "--junit-xml", task["results"]]
        sys.argv = ["launch_test", *names, task["file"], *task["arguments"]]
        launch_test.main()  # does not return
    arguments = [(name, value) for name, _, value in (argument.partition(":=") for argument in task["arguments"])]
    file = IncludeLaunchDescription(AnyLaunchDescriptionSource(task["file"]), launch_arguments=arguments)
    service = LaunchService(argv=task["arguments"], noninteractive=True)
    service.include_launch_description(LaunchDescription([file]))
    # Nodes may finish their work: the simulation decides when the launch is over.
    return int(service.run(shutdown_when_idle=False))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
