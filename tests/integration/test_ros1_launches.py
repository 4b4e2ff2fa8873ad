"""Calls of `sim-action rostest` and `roslaunch` from end to end, beyond what examples do."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from junitparser import JUnitXml

from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from sim_action.state.trace_storage import load_trace
from tests.ros.ros1.launches import ROOT, needs_ros, package

pytestmark = needs_ros

ROBOT = ROOT / "sim_action/ros/ros1/launch/packages/turtlebot3_description/urdf/turtlebot3_burger.urdf.xacro"
WORLD = '<include file="$(find gazebo_ros)/launch/empty_world.launch"/>'
BURGER = '<include file="$(find turtlebot3_gazebo)/launch/turtlebot3_empty_world.launch"/>'
WAITS = """\
#!/usr/bin/env python
import unittest, rospy, rostest
class Waits(unittest.TestCase):
    def test_waiting(self):
        rospy.init_node("waits")
        rospy.sleep(float(rospy.get_param("~seconds", 0.5)))
    def test_nothing(self):
        pass
rostest.rosrun("parts", "waits", Waits)
"""
TEST = '<test test-name="{name}" pkg="parts" type="waits.py" time-limit="60"><param name="seconds" value="{s}"/></test>'
DIES = (
    "#!/usr/bin/env python\nimport rospy\nrospy.init_node('dies')\nrospy.sleep(0.2)\nraise ValueError('no battery')\n"
)


def called(folder: Path, program: str, file: str, *words: str) -> tuple[int, list[Outcome]]:
    """A call in a folder that is a workspace with the package `parts`."""
    command = [sys.executable, "-m", "sim_action", program, "parts", file, *words]
    variables = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, check=False, cwd=folder, env=variables, capture_output=True, text=True)
    results = Results.model_validate_json((folder / "sim-results/results.json").read_bytes())
    assert results.exit_code == done.returncode
    assert JUnitXml.fromfile(str(folder / "sim-results/junit.xml")).tests
    return done.returncode, list(results.outcomes)


def test_a_launch_passes_at_its_limit_of_sim_time_also_where_temporary_files_have_blanks_in_their_paths(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path / "with a blank"))
    (tmp_path / "with a blank").mkdir()
    package(tmp_path, "parts", {"a.launch": f"<launch>{BURGER}</launch>"})
    code, [outcome] = called(tmp_path, "roslaunch", "a.launch", "--sim-time-limit", "0.5")

    assert code == 0
    assert (outcome.name, outcome.end) == ("parts/a.launch", "time limit")
    assert outcome.sim_time == pytest.approx(0.5, abs=0.02)
    assert outcome.replay is not None
    assert outcome.provenance is not None


def test_a_launch_fails_if_a_node_dies(tmp_path: Path) -> None:
    launch = f'<launch>{BURGER}<node pkg="parts" name="it" type="dies.py"/></launch>'
    package(tmp_path, "parts", {"a.launch": launch, "dies.py": DIES})
    # The node needs some real time to end, and roslaunch some to notice it: 20 s of sim time are over two of real time.
    code, [outcome] = called(tmp_path, "roslaunch", "a.launch", "--sim-time-limit", "20")

    assert (code, outcome.status) == (1, "failed")
    assert outcome.expectations[0].verdict.message.startswith("the node 'it' ended with exit code 1")


def test_each_test_of_a_file_has_a_simulation_of_its_own(tmp_path: Path) -> None:
    tests = TEST.format(name="long", s=1.0) + "\n" + TEST.format(name="brief", s=0.3)
    package(tmp_path, "parts", {"a.test": f"<launch>{BURGER}\n{tests}</launch>", "waits.py": WAITS})
    code, outcomes = called(tmp_path, "rostest", "a.test")

    assert code == 0
    found = {outcome.name: outcome for outcome in outcomes}
    assert found.keys() == {"parts/long", "parts/brief"}
    assert (found["parts/long"].line, found["parts/brief"].line) == (2, 3)
    assert (found["parts/long"].sim_time or 0) > (found["parts/brief"].sim_time or 9)
    names = ["test_nothing", "test_waiting"]
    assert [[each.name for each in outcome.expectations] for outcome in outcomes] == [names, names]
    assert len({outcome.trace for outcome in outcomes}) == 2


def test_what_takes_too_long_is_ended_by_the_wall_limit(tmp_path: Path) -> None:
    test = TEST.format(name="waits", s=50)
    package(tmp_path, "parts", {"a.test": f"<launch>{BURGER}{test}</launch>", "waits.py": WAITS})
    code, [outcome] = called(tmp_path, "rostest", "a.test", "--wall-limit", "15", "--rtf", "0.1")

    assert (code, outcome.status) == (1, "failed")
    messages = [expected.verdict.message for expected in outcome.expectations]
    assert any("within the wall limit of the call" in message for message in messages), messages


def test_a_model_is_spawned_from_a_file_where_and_as_it_is_asked_for(tmp_path: Path) -> None:
    spawn = (
        '<node pkg="gazebo_ros" name="spawn" type="spawn_model" args="-urdf -file $(find parts)/r.urdf -model r '
        '-x 1.5 -y -2 -Y 1.0 -J wheel_left_joint 0.5 -unpause"/>'
    )
    test = TEST.format(name="waits", s=0.2)
    paused = WORLD.replace("/>", '><arg name="paused" value="true"/></include>')
    files = {"a.test": f"<launch>{paused}{spawn}{test}</launch>", "waits.py": WAITS, "r.urdf": ROBOT.read_text()}
    package(tmp_path, "parts", files)
    code, [outcome] = called(tmp_path, "rostest", "a.test")

    assert code == 0, outcome
    assert outcome.trace is not None
    trace = load_trace(tmp_path / "sim-results" / outcome.trace)
    assert trace.base_position_xyz[0, :2] == pytest.approx([1.5, -2.0], abs=1e-3)


@pytest.mark.parametrize(
    ("words", "cause"),
    [
        (["prts", "a.test"], "there is no package 'prts'"),
        (["parts", "b.test"], "the package has no file 'b.test'; did you mean 'a.test'?"),
    ],
)
def test_what_is_not_there_is_reported_with_the_nearest(tmp_path: Path, words: list[str], cause: str) -> None:
    package(tmp_path, "parts", {"a.test": "<launch/>"})
    command = [sys.executable, "-m", "sim_action", "rostest", *words]
    done = subprocess.run(command, check=False, cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)})
    [outcome] = Results.model_validate_json((tmp_path / "sim-results/results.json").read_bytes()).outcomes
    assert done.returncode == 2
    assert cause in outcome.failures[0].message


def test_a_file_without_a_test_says_so(tmp_path: Path) -> None:
    package(tmp_path, "parts", {"a.test": "<launch/>"})
    code, [outcome] = called(tmp_path, "rostest", "a.test")
    assert code == 2
    assert "has no <test>" in outcome.failures[0].message
