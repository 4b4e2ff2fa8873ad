"""Nodes in scenarios: problems with their place in the file, workspaces, and names of topics."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from sim_action.core.errors import InvalidScenario, SourceProblem
from sim_action.core.permissions import Permissions
from sim_action.core.workspace import Workspace
from sim_action.ros.ros1 import installation
from sim_action.ros.ros1.command_source.file_problems import local_ros
from sim_action.ros.ros1.command_source.spec import RosCommands
from sim_action.scenario.loading import load_scenario
from tests.ros.ros1.launches import needs_ros, package
from tests.scenarios import LEAST, load, told
from tests.traces import scene

pytestmark = pytest.mark.process
NODE = "#!/usr/bin/env python\n"
LAUNCH = """\
<launch>
  <arg name="x" default="1"/>
  <group><arg name="name" default="b"/></group>
  <arg name="fixed" value="3"/>
  <include file="a.launch"><arg name="handed" value="$(arg x)"/></include>
</launch>
"""
NEEDS = '<launch><arg name="must" doc="what for"/></launch>'
TWIST = "  rate: 10 Hz\n  twist:\n    - {linear: 1.0}\n"


def text(ros1: str) -> str:
    """A scenario with nodes; what is said of them stands on line 5, from column 9 on."""
    return LEAST.replace(TWIST, f"  ros1: {ros1}\n")


def workspace(folder: Path) -> None:
    files = {"mover.py": NODE, "launch/drive.launch": LAUNCH, "launch/needs.launch": NEEDS, "launch/no.launch": "<a>"}
    made = package(folder, "driver", files)
    (made / "helper.sh").write_text("")


GOOD = [
    "{launch: [driver, drive.launch]}",
    "{launch: [driver, launch/drive.launch, 'x:=1', 'name:=a b']}",
    "{launch: [driver, needs.launch, 'must:=']}",
    "{nodes: [driver/mover.py]}",
    "{nodes: [driver/mover.py, {package: driver, type: mover.py, name: second, params: {speed: 0.5, list: [1, a]}}]}",
    "{nodes: [driver/mover.py], workspace: ., topics: {cmd_vel: /robot/cmd_vel}, start_within: 1 min}",
]


@pytest.mark.parametrize("ros1", GOOD)
def test_nodes_of_the_workspace_are_found(ros1: str, tmp_path: Path) -> None:
    workspace(tmp_path)
    (source,) = load(tmp_path, text(ros1)).scenario.commands
    assert isinstance(source, RosCommands)
    assert source.rate == 120


BAD = [
    ("{}", 5, 3, "needs either 'launch' or 'nodes'; give one of them"),
    ("{launch: [driver, drive.launch], nodes: [driver/mover.py]}", 5, 3, "remove one of them"),
    ("{launch: [driver]}", 5, 10, "needs a package and a launch file, such as [my_robot, drive.launch]"),
    ("{launch: [driver, drve.launch]}", 5, 27, "no file 'drve.launch'; did you mean 'drive.launch'?"),
    ("{launch: [driver, drive.launch, 'nam:=1']}", 5, 41, "no argument 'nam'; did you mean 'name'?"),
    ("{launch: [driver, drive.launch, 'handed:=1']}", 5, 41, "'drive.launch' has no argument 'handed'"),
    ("{launch: [driver, drive.launch, 'x:=2', 'fixed:=1']}", 5, 49, "'fixed' has a fixed value in 'drive.launch'"),
    ("{launch: [driver, needs.launch]}", 5, 27, "needs the argument 'must': give it as must:=VALUE"),
    ("{launch: [driver, no.launch]}", 5, 27, "'no.launch' is not a launch file: no element found: line 1, column 3"),
    ("{launch: [driver, drive.launch, x=1]}", 5, 41, "'x=1' is not an argument of a launch file; write NAME:=VALUE"),
    ("{nodes: [driver/mver.py]}", 5, 18, "no node 'mver.py'; did you mean 'mover.py'?"),
    ("{nodes: [driver/helper.sh]}", 5, 18, "'helper.sh' of 'driver' is not executable; run chmod +x"),
    ("{nodes: [mover.py]}", 5, 18, "the short form of a node is package/type"),
    ("{nodes: [driver/mover.py, driver/mover.py]}", 5, 35, "a second node named 'mover'"),
    ("{nodes: [{package: driver, type: mover.py, name: a b}]}", 5, 52, "the name of a node has letters"),
    ("{nodes: [{package: driver, typ: mover.py}]}", 5, 36, "unknown key; did you mean 'type'?"),
    ("{nodes: [driver/mover.py], topics: {cmd_vel: a b}}", 5, 45, "a name in ROS has letters"),
    ("{nodes: [driver/mover.py], topics: {cmd: /x}}", 5, 45, "the robot has no 'cmd'"),
    ("{nodes: [driver/mover.py], workspace: nowhere}", 5, 36, "does not exist"),
]


@pytest.mark.parametrize(("ros1", "line", "column", "message"), BAD)
def test_what_is_wrong_is_told_with_its_place(ros1: str, line: int, column: int, message: str, tmp_path: Path) -> None:
    workspace(tmp_path)
    problems = told(tmp_path, text(ros1))
    assert [said for said in problems if said.startswith(f"{line}:{column}: ") and message in said], problems


@needs_ros
@pytest.mark.parametrize(
    ("ros1", "column"), [("{nodes: [drver/mover.py]}", 18), ("{launch: [drver, drive.launch]}", 19)]
)
def test_a_package_that_nobody_has_is_told_with_the_nearest(ros1: str, column: int, tmp_path: Path) -> None:
    workspace(tmp_path)
    (problem,) = told(tmp_path, text(ros1))
    assert problem.startswith(f"5:{column}: ")
    assert "there is no package 'drver'" in problem
    assert "did you mean 'driver'?" in problem


def test_nodes_are_refused_where_scripts_are(tmp_path: Path) -> None:
    workspace(tmp_path)
    file = load(tmp_path, text(GOOD[2])).source.path
    with pytest.raises(InvalidScenario, match=r"5:3: commands\.ros1: no scripts here"):
        load_scenario(file, Permissions(scripts_refused="no scripts here"))


def test_a_rate_that_falls_between_physics_steps_is_told_with_those_that_do_not(tmp_path: Path) -> None:
    workspace(tmp_path)
    (problem,) = told(tmp_path, text(GOOD[2]) + "physics: {rate: 200 Hz}\n")
    assert "nearest: 100 Hz and 200 Hz" in problem


def test_where_ros_is_absent_a_file_is_valid_and_cannot_be_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation, "PYTHON", tmp_path / "no-python")
    local_ros.cache_clear()
    workspace(tmp_path)
    try:
        loaded = load(tmp_path, text(GOOD[2]))
        source = loaded.scenario.commands[0]
        assert any("apt-get install --no-install-recommends python3-rospy" in remark for remark in loaded.unchecked)
        with pytest.raises(SourceProblem, match="ROS 1 is not installed") as raised:
            source.open(replace(scene(), workspace=Workspace(tmp_path, tmp_path)))
        assert raised.value.key == "ros1"
    finally:
        local_ros.cache_clear()
