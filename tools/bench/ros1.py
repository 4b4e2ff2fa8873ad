"""Measure the parts of a rostest: the example's mover on real ROS, with sim-action instead of Gazebo."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Final, NamedTuple

from sim_action.core.errors import UsageError
from sim_action.core.process import Interruption
from sim_action.ros.launches import LaunchRequest
from sim_action.ros.ros1.command import LaunchCall
from sim_action.ros.ros1.installation import Ros, find_ros
from sim_action.ros.ros1.launch.overlay import build_overlay
from sim_action.ros.ros1.launch_request import PROCESS_FILE, RUN_FILE

EXAMPLES: Final = Path(__file__).resolve().parents[2] / "examples/ros1"
ROUNDS: Final = 4


class Parts(NamedTuple):
    """One rostest, in s of wall time, but for `sim_time` and `processor`.

    Attributes:
        overlay: until ROS can be called.
        roscore: until the simulation's process is there: roslaunch, the master.
        imports: until the clock starts: rospy, the engine, all other nodes.
        sim: the simulation.
        teardown: until nothing is left.
        sim_time: s of sim time.
        processor: s that all processes together have computed.
    """

    overlay: float
    roscore: float
    imports: float
    sim: float
    teardown: float
    sim_time: float
    processor: float

    def __str__(self) -> str:
        parts = ", ".join(f"{name} {getattr(self, name):.2f} s" for name in self._fields[:5])
        return f"     {parts}; {self.processor:.2f} s of processors"


def ros() -> Ros | None:
    """None: it is not installed here."""
    try:
        return find_ros()
    except UsageError:
        return None


def parts(ros: Ros) -> Parts:
    """Return the parts of the quickest of several runs; the first one fills caches."""
    return min((_parts(ros) for _ in range(ROUNDS)), key=lambda run: sum(run[:5]))


def command() -> float:
    """Wall time in s of `sim-action rostest`, all reports included; the least of some runs."""
    return min(_command() for _ in range(ROUNDS))


def _command() -> float:
    words = ["-m", "sim_action", "rostest", "--workspace", str(EXAMPLES), "robot_driver", "mover.test"]
    with tempfile.TemporaryDirectory() as folder:
        variables = {**os.environ, "PYTHONPATH": str(EXAMPLES.parents[1]), "GITHUB_ACTIONS": ""}
        started = time.perf_counter()
        subprocess.run([sys.executable, *words], cwd=folder, env=variables, check=True, capture_output=True)
        return time.perf_counter() - started


def _parts(ros: Ros) -> Parts:
    request = LaunchRequest("rostest", "robot_driver", "mover.test", workspace=EXAMPLES)
    with tempfile.TemporaryDirectory() as name, Interruption() as interruption:
        folder = Path(os.path.realpath(name))
        for made in ("overlay", "call"):
            (folder / made).mkdir()
        before = _processor()
        began = time.time()
        overlay = build_overlay(folder / "overlay", ros, EXAMPLES, os.environ)
        launched = time.time()
        call = LaunchCall(request, ros, overlay, folder / "call")
        (run,) = call.launched(call.files(), interruption).runs
        ended = time.time()
        assert run.result is not None
        assert run.result.real_time_factor
        born, over = ((run.folder / file).stat().st_mtime for file in (PROCESS_FILE, RUN_FILE))
        sim = run.result.sim_time / run.result.real_time_factor
        return Parts(
            overlay=launched - began,
            roscore=born - launched,
            imports=over - sim - born,
            sim=sim,
            teardown=ended - over,
            sim_time=run.result.sim_time,
            processor=_processor() - before,
        )


def _processor() -> float:
    """Return the processor time of all children in s."""
    used = os.times()
    return used.children_user + used.children_system
