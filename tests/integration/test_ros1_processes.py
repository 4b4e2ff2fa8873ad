"""Nothing of a launch is left, whoever ends it: real signals to real processes of ROS."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from sim_action.ros.processes import command_line
from tests.integration.marked_processes import processes_of, wait_for
from tests.patience import PATIENCE, wait_until
from tests.ros.ros1.launches import ROOT, needs_ros, package
from tests.soak import soaked

pytestmark = needs_ros

MOVER = """\
#!/usr/bin/env python
import os, signal, rospy
from geometry_msgs.msg import Twist
signal.signal(signal.SIGTERM, signal.SIG_IGN)
rospy.init_node("mover")
publisher = rospy.Publisher("/cmd_vel", Twist, queue_size=1)
rate = rospy.Rate(10)
while not rospy.is_shutdown():
    publisher.publish(Twist())
    rate.sleep()
    if rospy.get_time() > 0.5:
        open(os.environ["ROS_BEGUN"], "w").close()
"""
TEST = """\
#!/usr/bin/env python
import os, time, unittest, rospy, rostest
class Waits(unittest.TestCase):
    def test_waiting(self):
        rospy.init_node("waits")
        if os.fork() == 0:
            os.setsid()
            time.sleep(600)
        while not rospy.is_shutdown():
            rospy.sleep(1)
rostest.rosrun("waiting", "waits", Waits)
"""
LAUNCH = """\
<launch>
  <include file="$(find turtlebot3_gazebo)/launch/turtlebot3_empty_world.launch"/>
  <node pkg="waiting" name="mover" type="mover.py"/>
  <test test-name="waits" pkg="waiting" type="waits.py" time-limit="500"/>
</launch>
"""


def called(folder: Path, words: str) -> int:
    lines = {pid: command_line(pid).replace(b"\0", b" ") for pid in processes_of(folder)}
    return min(pid for pid, line in lines.items() if words.encode() in line)


def ended_by(folder: Path, end: Callable[[int], None], program: str = "rostest") -> tuple[int, Outcome | None]:
    """What becomes of a call whose test would never be over, once something is done in the midst of it."""
    files = {"mover.py": MOVER, "waits.py": TEST, "waits.test": LAUNCH}
    package(folder / "ws", "waiting", files)
    begun = folder / "begun"
    variables = {**os.environ, "PYTHONPATH": str(ROOT), "ROS_MARK": str(folder), "ROS_BEGUN": str(begun)}
    words = [program, "--workspace", "ws", "waiting", "waits.test", "--sim-time-limit", "500"]
    command = [sys.executable, "-m", "sim_action", *words]
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "start_new_session": True}
    call = subprocess.Popen(command, cwd=folder, env=variables, **quiet)
    try:
        wait_until(begun.exists)
        end(call.pid)
        code = call.wait(PATIENCE)
    finally:
        call.kill()
    results = folder / "sim-results/results.json"
    outcome = Results.model_validate_json(results.read_bytes()).outcomes[0] if results.exists() else None
    return code, outcome


@pytest.mark.parametrize("number", soaked([signal.SIGINT, signal.SIGTERM], short=[signal.SIGTERM]))
def test_an_interrupted_call_reports_and_leaves_nothing(tmp_path: Path, number: signal.Signals) -> None:
    code, outcome = ended_by(tmp_path, lambda call: os.kill(call, number))
    assert code == 130
    assert outcome is not None
    assert [failure.kind for failure in outcome.failures] == ["interrupted"]
    assert processes_of(tmp_path) == []


def test_a_call_that_is_killed_outright_leaves_nothing(tmp_path: Path) -> None:
    code, outcome = ended_by(tmp_path, lambda call: os.kill(call, signal.SIGKILL))
    assert code == -signal.SIGKILL
    assert outcome is None
    wait_for(0, tmp_path)


SUPERVISOR = "sim_action.runner.isolation.command_supervisor"
GAZEBO = "sim_action.ros.ros1.launch.programs gzserver"


@pytest.mark.parametrize(
    ("program", "victim", "cause"),
    [
        ("rostest", "rostestmain", "the launcher was ended by SIGKILL"),
        ("rostest", SUPERVISOR, "the launcher was ended by SIGKILL"),
        ("rostest", GAZEBO, "the node 'gazebo' ended with SIGKILL"),
        pytest.param("roslaunch", "rosmaster", "the master does not answer", marks=pytest.mark.soak),
    ],
)
def test_whatever_is_killed_nothing_is_left_and_there_is_a_report(
    tmp_path: Path, program: str, victim: str, cause: str
) -> None:
    code, outcome = ended_by(tmp_path, lambda _: os.kill(called(tmp_path, victim), signal.SIGKILL), program)
    assert processes_of(tmp_path) == []
    assert code == 1
    assert outcome is not None
    assert outcome.status == "error"
    assert cause in outcome.failures[0].message
