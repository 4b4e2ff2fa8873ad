"""Nodes of ROS 2 that fail or misbehave: each outcome names the node and the cause, and nothing is left over."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import pytest

from sim_action.runner.isolation.process_control import processes
from tests.patience import PATIENCE, wait_until
from tests.ros.ros2.nodes import needs_ros2, outcomes, scenario, variables
from tests.soak import soaked

pytestmark = needs_ros2

MOVER: Final = """\
import ctypes, os, signal, subprocess, sys, threading, time
import rclpy
from geometry_msgs.msg import Twist
from rclpy.node import Node
from std_msgs.msg import String

KIND = Twist


class Mover(Node):
    def __init__(self):
        super().__init__("mover")
        self.publisher = self.create_publisher(KIND, "TOPIC", 10)
        self.create_timer(0.1, self.on_timer)
        pass  # in __init__

    def on_timer(self):
        twist = Twist()
        twist.linear.x = 0.5
        pass  # in on_timer
        self.publisher.publish(twist)


rclpy.init()
rclpy.spin(Mover())
"""
IN_INIT, IN_TIMER = 15, 20  # lines of the mover that a fault replaces


def faulty(folder: Path, name: str, init: str = "pass", timer: str = "pass", kind: str = "Twist", **more: Any) -> None:
    """Write a mover with a fault, and a scenario that it drives for 0.4 s."""
    text = MOVER.replace("pass  # in __init__", init).replace("pass  # in on_timer", timer)
    text = text.replace("KIND = Twist", f"KIND = {kind}").replace("TOPIC", more.pop("topic", "cmd_vel"))
    (folder / f"{name}_node.py").write_text(more.pop("text", text))
    listed = more.pop("nodes", f"[./{name}_node.py]")
    scenario(folder, name, f"{{nodes: {listed}}}", seconds=0.4, **more)


def told(outcome: dict[str, Any]) -> tuple[str, int | None]:
    """Return the message of a failure, and the line in the user's code."""
    failure = outcome["failures"][0]
    file = (failure["location"] or {}).get("file", "")
    return failure["message"], failure["location"]["line"] if file.endswith("_node.py") else None


def warned(outcome: dict[str, Any]) -> dict[str, str]:
    """Return the warnings of a run that passed, by their rules."""
    assert outcome["status"] == "passed", outcome
    return {warning["rule"]: warning["message"] for warning in outcome["warnings"]}


def left_over(folder: Path) -> list[str]:
    """Return the command lines of processes that run in a folder."""
    found = []
    for process in processes():
        with suppress(OSError):
            if Path(f"/proc/{process.number}/cwd").readlink() == folder:
                found.append(Path(f"/proc/{process.number}/cmdline").read_text())
    return found


KILLS: Final = """
        parent = os.getppid()
        others = open(f"/proc/{parent}/task/{parent}/children").read().split()
        [os.kill(int(each), signal.SIGKILL) for each in others if int(each) != os.getpid()]
"""
"""Kills the bridge."""


def test_each_outcome_names_the_cause(tmp_path: Path) -> None:
    faulty(tmp_path, "raises", init='raise RuntimeError("no map")')
    faulty(tmp_path, "imports", text="__import__('not_there')\n")
    faulty(tmp_path, "lacks", text="import not_there\n")
    faulty(tmp_path, "crashes", timer="ctypes.string_at(0)")
    faulty(tmp_path, "fatal", timer='self.get_logger().fatal("no power"); os._exit(3)')
    faulty(tmp_path, "nan", timer='twist.linear.x = float("nan")')
    faulty(tmp_path, "text", kind="String")
    faulty(tmp_path, "two", nodes="[./two_node.py, {file: ./two_node.py, name: other}]")
    faulty(tmp_path, "kills", timer=KILLS)
    faulty(tmp_path, "leaves", timer="sys.exit(0)", nodes="[{file: ./leaves_node.py, required: true}]")
    found = {name: told(outcome) for name, outcome in outcomes(tmp_path, ".", "-j", "2").items()}
    message, line = found.pop("lacks")
    assert message.startswith("commands.ros2.nodes.0: 'lacks_node.py' imports 'not_there', and ")
    assert line is None
    message, line = found.pop("raises")
    assert message.endswith("the node 'raises_node' ended with exit code 1: RuntimeError: no map")
    assert line == IN_INIT
    message, _ = found.pop("nan")
    assert message.startswith("at 0.1 s of sim time, '/mover' sent a bad command on /cmd_vel: ")
    message, _ = found.pop("text")
    assert "'/mover' publishes /cmd_vel as std_msgs/msg/String, but the robot takes geometry_msgs/msg/Twist" in message
    message, _ = found.pop("two")
    assert "2 nodes publish /cmd_vel, which commands the robot: /mover, /other" in message
    at = "at 0.1 s of sim time, the node"
    hint = "; install it for the Python of ROS 2, or use a ROS 2 that has it, such as ros:jazzy"
    assert found == {
        "imports": (
            f"the node 'imports_node' ended with exit code 1: ModuleNotFoundError: No module named 'not_there'{hint}",
            1,
        ),
        "crashes": (f"{at} 'crashes_node' ended with SIGSEGV: Segmentation fault", IN_TIMER),
        "kills": ("at 0.1 s of sim time, the bridge to ROS 2, a process of sim-action, ended with SIGKILL", None),
        "fatal": (f"{at} 'fatal_node' ended with exit code 3 after it logged the error: no power", None),
        "leaves": (f"{at} 'leaves_node' finished during the run, and it is required", None),
    }
    assert left_over(tmp_path) == []


HOSTILE: Final = """
        subprocess.Popen(["sleep", "86399"])
        subprocess.Popen(["sleep", "86399"], start_new_session=True)
        if os.fork() == 0:
            os.setsid()
            if os.fork() == 0:
                os.execvp("sleep", ["sleep", "86399"])
            os._exit(0)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)
"""
"""Starts children that outlive the node, and cannot be interrupted."""

LOUD: Final = """self.get_logger().error("no plan")
        print("x" * 2_000_000, "GITHUB_TOKEN" in os.environ, flush=True)
"""


def test_a_run_goes_on_with_what_it_heard(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GITHUB_TOKEN", "secret")
    faulty(tmp_path, "loud", init=HOSTILE, timer=LOUD, nodes="[./loud_node.py, {file: ./silent_node.py, name: silent}]")
    waits = 'self.create_subscription(String, "goal", print, 10)'
    faulty(tmp_path, "silent", init=waits, timer="sys.exit(0)", topic="base/cmd_vel")
    found = outcomes(tmp_path, ".", "-j", "2")
    loud, silent = found["loud"], found["silent"]
    logged = "the node 'mover' logged an error 3 times, first at 0.1 s of sim time: no plan (loud_node.py:30)"
    assert warned(loud) == {"logged-error": logged}
    assert loud["travelled"] > 0.01
    assert "x False" in loud["output"]
    finished = "finished at 0.1 s of sim time; its last command holds"
    assert f"the node 'silent' {finished}" in loud["notes"]
    message = warned(silent)["silent-controller"]
    assert message.endswith(
        "; no node sent a message on /cmd_vel; the node 'silent_node' finished at 0.1 s of sim time"
    )
    assert "'/mover' waits for /goal, which nothing publishes" in silent["notes"]
    assert left_over(tmp_path) == []


HANGS: Final = 'import time\nopen("up", "w").close()\ntime.sleep(600)\n'


@pytest.mark.parametrize("number", soaked([signal.SIGINT, signal.SIGTERM], short=[signal.SIGTERM]))
def test_an_interrupted_command_leaves_nothing(tmp_path: Path, number: signal.Signals) -> None:
    hang = {"text": HANGS} if number == signal.SIGINT else {"timer": 'open("up", "w").close(); time.sleep(600)'}
    faulty(tmp_path, "slow", **hang)
    command = [sys.executable, "-m", "sim_action", "run", "."]
    with subprocess.Popen(command, cwd=tmp_path, env=variables(), start_new_session=True) as running:
        wait_until((tmp_path / "up").exists)
        os.kill(running.pid, number)
        assert running.wait(PATIENCE) == 130
    assert left_over(tmp_path) == []
