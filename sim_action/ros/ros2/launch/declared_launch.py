"""The launcher for a ROS 2 without `launch`, which writes the events of launcher.py.

It runs on the Python of ROS. Where `launch` is installed, launcher.py runs instead.
"""

from __future__ import annotations

import importlib.util
import itertools
import json
import os
import runpy
import selectors
import signal
import subprocess
import sys
import time
import traceback
from pathlib import Path
from types import ModuleType
from typing import Any

if __name__ == "__main__":
    # Only modules of this folder are imported, not the whole package with its dependencies.
    sys.modules["sim_action"] = ModuleType("sim_action")
    sys.modules["sim_action"].__path__ = [str(Path(__file__).resolve().parents[3])]

from sim_action.ros.ros2.launch.declared_files import install_modules, read_file
from sim_action.ros.ros2.launch.declared_parts import program_path
from sim_action.ros.ros2.launch.declared_table import (
    KINDS,
    Context,
    LaunchError,
    Part,
    event_writer,
    stand_in_of,
    unsupported,
)

# The wall time that processes get after SIGINT.
_MAX_END_S = 2.5
_READ_BYTES = 65536


class _Launcher:
    """Runs the actions, and writes events."""

    def __init__(self, task: dict[str, Any]) -> None:
        self._task = task
        self.tell = event_writer(task)
        self._selector = selectors.DefaultSelector()
        self._times = os.open(task["times"], os.O_RDWR | os.O_NONBLOCK)
        self._selector.register(self._times, selectors.EVENT_READ)
        self._signals, writer = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        signal.set_wakeup_fd(writer)
        signal.signal(signal.SIGCHLD, lambda *_: None)
        self._selector.register(self._signals, selectors.EVENT_READ)
        self._running: list[tuple[str, subprocess.Popen[bytes], Part, dict[str, Any]]] = []
        self._unread: dict[str, bytes] = {}
        self._ended: list[tuple[Part, dict[str, Any], int]] = []
        self._clocks = itertools.count()
        self._numbers = itertools.count(1)
        self._timers = 0
        self._context = Context(self._start, read_file, Path(task["events"]).parent)

    def run(self) -> None:
        """Launch. Does not return before the launch is ended."""
        words = dict(argument.split(":=", 1) for argument in self._task["arguments"])
        self._context.launch_configurations.update(words)
        self._visit(KINDS["launch.actions.IncludeLaunchDescription"].part((self._task["file"],)))
        if unknown := sorted(words.keys() - self._context.declared - self._context.used):
            raise LaunchError("argument", name=unknown[0], names=sorted(self._context.declared))
        self._settle(0.0)
        while True:
            ready = {key.fileobj: key.data for key, _ in self._selector.select()}
            for source, name in ready.items():
                if name:
                    self._forward(source, name)
            if self._signals in ready:
                os.read(self._signals, _READ_BYTES)
                self._reap()
            if self._times in ready:
                # Run timers that are due.
                seconds = float(os.read(self._times, _READ_BYTES).split()[-1])
                self._context.now = seconds
                due = sorted((pair for pair in self._context.timers if pair[0] <= seconds), key=lambda pair: pair[0])
                self._context.timers = [pair for pair in self._context.timers if pair[0] > seconds]
                self._timers = len(self._context.timers)
                for _, actions in due:
                    self._visit(actions)
                self._settle(seconds)

    def end(self) -> None:
        """Wait until the processes have ended after SIGINT, and print what they say."""
        self._context.handle("OnShutdown", None)
        deadline = time.monotonic() + _MAX_END_S
        while any(process.poll() is None for _, process, _, _ in self._running) and time.monotonic() < deadline:
            for key, _ in self._selector.select(0.05):
                if key.data:
                    self._forward(key.fileobj, key.data)

    def _visit(self, actions: Any) -> None:
        """Run actions, and report the timers and the end that they state."""
        self._context.visit(actions)
        for due, _ in self._context.timers[self._timers :]:
            self.tell("timer", time=due)
        self._timers = len(self._context.timers)
        if self._context.shutdown is not None:
            self.tell("shutdown", message=self._context.shutdown)
            raise KeyboardInterrupt

    def _settle(self, seconds: float) -> None:
        """Handle the ends of programs that are left out, and report that nothing more starts at this time."""
        while self._ended:
            self._handle_exit(*self._ended.pop(0))
        self.tell("calm", time=seconds, pid=os.getpid())

    def _start(self, action: Part, facts: dict[str, Any]) -> None:
        words: list[str] = facts["words"]
        package = facts["package"]
        # A command with its arguments in one word, as shells take it.
        program, *first = words[0].split() if facts["shell"] else words[:1]
        key = f"{package}/{program}" if package else program
        role: dict[str, Any] = {"process": f"{facts['label'] or Path(program).name}-{next(self._numbers)}"}
        role |= {"program": key, "node": facts["node"]}
        stand_in = stand_in_of(self._task["stand_ins"], key)
        if stand_in is not None:
            ros = facts["ros_words"] or []
            self.tell("left out", **role, args=[*first, *words[1:], *(["--ros-args", *ros] if ros else [])])
            if stand_in[0] != "sleep":
                self._ended.append((action, {**facts, **role}, 0))
            return
        if package:
            words[0] = role["program"] = program_path(program, package)
        is_run = (
            facts["ros_words"] is None and not facts["shell"] and [Path(program).name, *words[1:2]] == ["ros2", "run"]
        )
        if facts["ros_words"] is not None or is_run:
            role["clock"] = next(self._clocks)
            words += ["--ros-args", *(facts["ros_words"] or [])]
            words += ["-r", f"/clock:={self._task['clock'].format(role['clock'])}", "-p", "use_sim_time:=true"]
        try:
            process = subprocess.Popen(  # noqa: S603 - what the launch file asks for
                " ".join(words) if facts["shell"] else [*facts["prefix"], *words],
                shell=facts["shell"],
                env=facts["env"],
                cwd=facts["cwd"],
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL,
            )
        except OSError as error:
            raise LaunchError("start", error.strerror or str(error), name=[*facts["prefix"], *words][0]) from None
        self._running.append((role["process"], process, action, {**facts, **role}))
        assert process.stdout is not None
        self._selector.register(process.stdout, selectors.EVENT_READ, role["process"])
        self.tell("process", **role, pid=process.pid)
        self._context.handle("OnProcessStart", action, process_name=role["process"], pid=process.pid)

    def _handle_exit(self, action: Part, facts: dict[str, Any], code: int) -> None:
        more = {"process_name": facts["process"], "returncode": code, "pid": 0}
        self._context.follow(facts["on_exit"], action=action, **more)
        self._context.handle("OnProcessExit", action, **more)
        self._visit(None)

    def _reap(self) -> None:
        """Handle processes that have ended: first their handlers, whose nodes sim time waits for."""
        for entry in [entry for entry in self._running if entry[1].poll() is not None]:
            name, process, action, facts = entry
            self._running.remove(entry)
            self._forward(process.stdout, name)
            if process.returncode == 0:
                if facts["respawn"]:
                    raise unsupported(f"'respawn' of '{name}', which has ended,")
                self._handle_exit(action, facts, 0)
            self.tell("died", process=name, pid=process.pid, exit_code=process.returncode)

    def _forward(self, source: Any, name: str) -> None:
        """Print the new lines of a process, each with its name."""
        if source not in (key.fileobj for key in self._selector.get_map().values()):
            return
        os.set_blocking(source.fileno(), False)
        while data := source.read(_READ_BYTES):
            *lines, self._unread[name] = (self._unread.get(name, b"") + data).split(b"\n")
            sys.stdout.buffer.write(b"".join(b"[%s] %s\n" % (name.encode(), line) for line in lines))
            sys.stdout.flush()
        if data == b"":
            self._selector.unregister(source)


def _is_installed(module: str) -> bool:
    # A folder `launch` of a package on PYTHONPATH is a namespace without an origin.
    spec = importlib.util.find_spec(module)
    return spec is not None and spec.origin is not None


def main(path: str) -> int:
    """Launch, and return the exit code."""
    task = json.loads(Path(path).read_text(encoding="utf-8"))
    if task["results"] or (_is_installed("launch") and _is_installed("launch_ros")):
        runpy.run_path(str(Path(__file__).with_name("launcher.py")), run_name="__main__")
    # Programs inherit a signal that is ignored, and would not end by it.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    install_modules()
    launcher = _Launcher(task)
    try:
        launcher.run()
    except KeyboardInterrupt:
        launcher.end()
    except Exception as error:  # noqa: BLE001 - launch files are code, and may raise anything
        refusal = LaunchError.of(error)
        launcher.tell("refused", **refusal.event, places=refusal.places)
        traceback.print_exc()
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
