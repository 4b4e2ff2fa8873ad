"""Packages of ROS 1 on real roscore, rospy and rostest: the examples, ROBOTIS's layout, and all that goes wrong."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from junitparser import JUnitXml

from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from sim_action.ros.launches import LaunchRequest
from sim_action.ros.ros1.launch_request import TRACE_FILE, SimulationResult
from sim_action.ros.ros1.verdicts.findings import Findings
from sim_action.state.trace_storage import load_trace
from tests.integration.conftest import sim_action
from tests.ros.ros1.launches import EXAMPLES, launched, needs_ros, told
from tests.soak import soaked

pytestmark = needs_ros
TESTS = ["mover", "go_to_point", "stop_before_wall"]


@contextmanager
def loaded() -> Iterator[None]:
    """All processors that this process and the ones that it starts may use have other work: there is one left."""
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(allowed)})
    busy = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)
        busy.kill()
        busy.wait()


def example(folder: Path, name: str, workspace: Path = EXAMPLES) -> Findings:
    return launched(folder, LaunchRequest("rostest", "robot_driver", f"{name}.test", workspace=workspace))


def rostest(folder: Path, workspace: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return sim_action(folder, "rostest", "--workspace", str(workspace), *words)


def outcomes(folder: Path) -> tuple[Outcome, ...]:
    return Results.model_validate_json((folder / "sim-results/results.json").read_bytes()).outcomes


def copied(folder: Path) -> Path:
    return shutil.copytree(EXAMPLES, folder / "ws")


def changed(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


# The others pass below, without the command.
@pytest.mark.soak
@pytest.mark.parametrize("name", TESTS)
def test_examples_pass(name: str, tmp_path: Path) -> None:
    done = rostest(tmp_path, EXAMPLES, "robot_driver", f"{name}.test")
    assert done.returncode == 0, done.stdout + done.stderr
    (outcome,) = outcomes(tmp_path)
    assert outcome.status == "passed"
    assert outcome.end == "test finished"
    assert outcome.trace is not None
    assert outcome.replay is not None


def seen(run: SimulationResult) -> tuple[object, ...]:
    assert run.in_step
    return run.digest, run.messages, run.sim_time, run.first_command, run.travelled


def idle_and_busy(folder: Path, name: str, idle: int, busy: int) -> list[Findings]:
    """Some runs while the machine has nothing else to do, some while all its processors have; all pass alike."""
    findings = [example(folder / f"idle{number}", name) for number in range(idle)]
    with loaded():
        findings += (example(folder / f"busy{number}", name) for number in range(busy))
    assert {(found.exit_code, told(found).end) for found in findings} == {(0, "test finished")}
    runs = [told(found) for found in findings]
    assert runs[0].messages["/clock"] > 100
    assert [seen(run) for run in runs] == [seen(runs[0])] * (idle + busy)
    return findings


@pytest.mark.parametrize(("idle", "busy"), soaked([(1, 0), (3, 3)], short=[(1, 0)]))
def test_the_mover_comes_as_far_as_physics_says_however_busy_the_machine_is(
    tmp_path: Path, idle: int, busy: int
) -> None:
    """It speeds up by 1 m/s^2 to 1 m/s: half a metre in the first second, one in the next."""
    findings = idle_and_busy(tmp_path, "mover", idle, busy)
    runs = [told(found) for found in findings]
    assert runs[0].first_command is not None
    trace = load_trace(findings[0].runs[0].folder / TRACE_FILE)
    way = np.interp([runs[0].first_command + 1, runs[0].first_command + 2], trace.time, trace.planar_distance_to(0, 0))
    assert way == pytest.approx([0.5, 1.5], abs=0.02)


@pytest.mark.soak
def test_a_closed_loop_is_the_same_however_busy_the_machine_is(tmp_path: Path) -> None:
    idle_and_busy(tmp_path, "go_to_point", 3, 3)


def test_a_time_limit_is_of_sim_time_and_each_test_has_its_own(tmp_path: Path) -> None:
    workspace = copied(tmp_path)
    second = '  <test test-name="too_far" pkg="robot_driver" type="test_mover.py" time-limit="1.5"/>\n</launch>'
    changed(workspace / LAUNCH, 'time-limit="30.0"/>\n</launch>', f'time-limit="3.0"/>\n{second}')
    # The first takes 2 s of sim time, which are 4 s of wall time and more.
    done = rostest(tmp_path, workspace, "robot_driver", "mover.test", "--rtf", "0.5")
    assert done.returncode == 1, done.stdout + done.stderr
    found = outcomes(tmp_path)
    assert len({outcome.trace for outcome in found}) == 2
    judged = {outcome.name: (outcome.status, outcome.line) for outcome in found}
    assert judged == {"robot_driver/test_mover": ("passed", 6), "robot_driver/too_far": ("failed", 7)}
    assert "did not finish within 1.5 s of sim time" in done.stdout


MOVER, TEST, LAUNCH = (f"src/robot_driver/{name}" for name in ("mover.py", "test_mover.py", "mover.test"))


HANGS, NO_FILE = "import time; time.sleep(600)", "turtlebot3_house"
soaked_case = partial(pytest.param, marks=pytest.mark.soak)


@pytest.mark.parametrize(
    ("file", "old", "new", "causes"),
    [
        soaked_case(TEST, "rospy.sleep(0.5)", HANGS, ["time"], id="the test hangs"),
        pytest.param(MOVER, "    rate =", "    1 / 0\n    rate =", ["mover", "ZeroDivisionError"], id="a node crashes"),
        pytest.param(LAUNCH, 'pkg="robot_driver" name="mover"', 'pkg="robo" name="mover"', ["robo"], id="no package"),
        pytest.param(LAUNCH, 'type="mover.py"', 'type="moover.py"', ["moover.py"], id="no node of this name"),
        soaked_case(LAUNCH, "turtlebot3_empty_world", NO_FILE, [NO_FILE], id="no launch file"),
        soaked_case(TEST, "def look(self, states):", "def look(self, states:", ["SyntaxError"], id="a syntax error"),
    ],
)
def test_what_goes_wrong_is_named(file: str, old: str, new: str, causes: list[str], tmp_path: Path) -> None:
    workspace = copied(tmp_path)
    changed(workspace / file, old, new)
    if file != LAUNCH:
        # A busy machine spawns the robot late.
        limit = 20.0 if file == MOVER else 6.0
        changed(workspace / LAUNCH, 'time-limit="30.0"', f'time-limit="{limit}"')
    done = rostest(tmp_path, workspace, "robot_driver", "mover.test")
    assert done.returncode in (1, 2), done.stdout + done.stderr
    (outcome,) = outcomes(tmp_path)
    said = [failure.message for failure in outcome.failures]
    said += [expected.verdict.message for expected in outcome.expectations]
    assert all(cause in " ".join((*said, *outcome.notes)) for cause in causes), (said, outcome.notes)
    suites = JUnitXml.fromfile(str(tmp_path / "sim-results/junit.xml"))
    assert (suites.failures or 0) + (suites.errors or 0) == 1
