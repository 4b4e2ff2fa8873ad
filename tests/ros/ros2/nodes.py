"""Scenarios with real nodes of ROS 2: where ROS 2 comes from, nodes to drive robots with, and their runs."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any, Final

import pytest

from sim_action.core.errors import UsageError
from sim_action.ros.ros2.installation import PYTHON_VARIABLE, find_ros

ROOT: Final = Path(__file__).parents[3]
WHEELS: Final = ROOT / ".venv/ros2/bin/python"  # the Python with the wheels of ROS 2 that `make test` installs


def variables() -> dict[str, str]:
    """Return the environment of commands: with the wheels, unless the variable names another Python."""
    stated = os.environ.get(PYTHON_VARIABLE) or (str(WHEELS) if WHEELS.exists() else "")
    return {**os.environ, "PYTHONPATH": str(ROOT), **({PYTHON_VARIABLE: stated} if stated else {})}


@cache
def missing_ros() -> str:
    """Why nodes cannot run here; empty if they can."""
    if sys.platform != "linux":
        return "nodes are watched by Linux's /proc"
    try:
        find_ros(variables())
    except UsageError as error:
        return str(error)
    return ""


def missing_launch() -> str:
    """Why launch files cannot run here; empty if they can."""
    if missing := missing_ros():
        return missing
    prefixes = find_ros(variables()).prefixes
    has_launch = any(path for prefix in prefixes for path in prefix.glob("lib/python3*/site-packages/launch_ros"))
    return "" if has_launch else "this ROS 2 has no launch_ros: the wheels of PyPI have none"


needs_launch = pytest.mark.skipif(bool(missing_launch()), reason=missing_launch())
needs_ros2 = pytest.mark.skipif(bool(missing_ros()), reason=missing_ros())

_EXAMPLES: Final = ROOT / "examples/ros2"
MOVER: Final = (_EXAMPLES / "first_steps/mover.py").read_text(encoding="utf-8")
"""Drives 1.5 m, in a loop closed by odometry."""

SMOOTHER: Final = (_EXAMPLES / "src/my_robot/my_robot/smoother.py").read_text(encoding="utf-8")
"""Follows the commands of another node on /cmd_vel_raw slowly; at some ticks, the timers of both are due."""


def scenario(folder: Path, name: str, ros2: str, more: str = "", seconds: float = 2.0) -> None:
    """Write a scenario of a robot that nodes drive."""
    text = f"name: {name}\nrobot: {{model: turtlebot3_burger}}\ncommands:\n  ros2: {ros2}\n"
    more = more or f"expect:\n  - path_length: {{at_most: {2 * seconds:g} m}}\n"
    # A busy machine takes many seconds for the start of a node.
    limits = f"time_limit: {seconds} s\n" + ("" if "wall_limit" in more else "wall_limit: 600 s\n")
    (folder / f"{name}.sim.yml").write_text(f"{text}{more}{limits}", encoding="utf-8")


def run(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run scenarios as typed in a folder."""
    return command(folder, "run", *words)


def command(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run a command of sim-action as typed in a folder."""
    typed = [sys.executable, "-m", "sim_action", *words]
    return subprocess.run(typed, capture_output=True, text=True, check=False, cwd=folder, env=variables())


def outcomes(folder: Path, *words: str) -> dict[str, dict[str, Any]]:
    """Run scenarios, and return their outcomes by their names."""
    done = run(folder, *words)
    results = folder / "sim-results/results.json"
    assert results.exists(), done.stdout + done.stderr
    return {outcome["name"]: outcome for outcome in json.loads(results.read_text(encoding="utf-8"))["outcomes"]}
