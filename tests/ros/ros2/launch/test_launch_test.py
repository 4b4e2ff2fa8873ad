"""Launch tests: the robot that `create` of ros_gz_sim spawns, and the warnings of a run."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from sim_action.core.errors import ScriptError
from sim_action.core.field_types import Placement
from sim_action.core.geometry import Twist
from sim_action.core.process import Interruption
from sim_action.reports import ReportRequest
from sim_action.robot.built_in import FOLDER
from sim_action.ros.launches import LaunchRequest
from sim_action.ros.lost_parts import LeftOutProgram
from sim_action.ros.ros2.bridge_link import Bridge
from sim_action.ros.ros2.installation import RMW, Ros2
from sim_action.ros.ros2.launch import launch_test
from sim_action.ros.ros2.launch.launch_test import spawned_robot
from sim_action.state.trace import Transcript
from tests.ros.ros2.prefixes import source

CREATE = "ros_gz_sim/create"


class Latched:
    """A bridge with one topic, whose message arrives at the second look."""

    def __init__(self) -> None:
        self.heard: list[Any] = [None]
        self.opened: list[str] = []
        self._looks = 0

    def open(self, _: Any, subscriptions: list[Any]) -> int:
        self.opened += [each.topic for each in subscriptions]
        return 0

    def take(self, _: Any) -> tuple[list[Any], list[int]]:
        self._looks += 1
        return [(0, {"data": "other"}), *([(1, {"data": "<robot/>"})] if self._looks > 1 else [])], []


def spawn(folder: Path, *args: str) -> Any:
    return spawned_robot([LeftOutProgram(CREATE, args)], cast("Bridge", Latched()), folder)


def test_a_description_from_a_topic(tmp_path: Path) -> None:
    bridge = Latched()
    programs = [
        LeftOutProgram("gz", ("sim", "empty.sdf")),
        LeftOutProgram(CREATE, ("-file", "/crate.sdf", "-name", "crate")),
        LeftOutProgram(CREATE, ("-topic", "robot_description", "-name", "bot", "--ros-args", "-r", "a:=b")),
    ]
    robot = spawned_robot(programs, cast("Bridge", bridge), tmp_path)
    assert (robot.name, robot.file.read_text(), bridge.opened) == ("bot", "<robot/>", ["/robot_description"])
    assert robot.pose == Placement()


def test_a_description_as_text_or_file_and_its_pose(tmp_path: Path) -> None:
    robot = spawn(tmp_path, "-string", "<robot name='a'/>", "-x", "1", "-y=-2", "--z", "0.5", "-Y", "3.1")
    assert robot.file.read_text() == "<robot name='a'/>"
    assert robot.pose == Placement(x=1, y=-2, z=0.5, yaw=3.1)
    assert spawn(tmp_path, "-file", "/bot.urdf").file == Path("/bot.urdf")


def test_no_robot_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ScriptError, match="spawns no robot"):
        spawned_robot([], cast("Bridge", Latched()), tmp_path)
    with pytest.raises(ScriptError, match="none of -topic, -string and -file"):
        spawn(tmp_path, "-name", "bot")
    with pytest.raises(ScriptError, match="'create -x left': this is not a number"):
        spawn(tmp_path, "-string", "<robot/>", "-x", "left")


class Launched:
    """A launch that spawns a robot, and whose test writes its results when it ends."""

    def __init__(self, spec: Any, _: Any) -> None:
        self._results = spec.results

    def await_programs(self) -> list[LeftOutProgram]:
        return [LeftOutProgram(CREATE, ("-file", str(FOLDER / "turtlebot3_burger.urdf")))]

    def close(self) -> None:
        self._results.write_text("<testsuite><testcase name='test_drives'/></testsuite>")


@pytest.mark.parametrize(
    ("nodes", "warned", "fails"),
    [
        ({}, [], False),
        ({"command": Twist((0.2, 0, 0))}, [], False),
        ({"command": Twist()}, ["silent-controller"], True),
        ({"logged_errors": ["no plan"]}, ["logged-error"], True),
        ({"not_reproducible": ["a node is never quiet"]}, ["not-reproducible"], True),
        ({"losses": ["no world"]}, ["not-simulated"], False),
    ],
)
def test_a_warning_fails_a_strict_test_unless_it_is_accepted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, nodes: dict[str, Any], warned: list[str], fails: bool
) -> None:
    command, errors = nodes.pop("command", None), nodes.pop("logged_errors", [])
    driven = SimpleNamespace(
        **{name: [] for name in ("notes", "losses", "not_reproducible")} | nodes,
        errors=SimpleNamespace(messages=errors),
        tick=lambda _: command,
        close=lambda: None,
        why_silent=str,
        transcript=Transcript(),
        has_heard=command is not None,
    )
    session = SimpleNamespace(folder=SimpleNamespace(path=tmp_path), bridge=SimpleNamespace(await_start=str))
    monkeypatch.setattr(launch_test, "find_ros", lambda: Ros2((), Path("python"), "jazzy", RMW, "test", {}))
    monkeypatch.setattr(launch_test, "Session", SimpleNamespace(open=lambda *_: session))
    monkeypatch.setattr(launch_test, "LaunchedNodes", Launched)
    monkeypatch.setattr(launch_test, "DrivenNodes", lambda *_: driven)
    source(tmp_path, "robot", {"test/drive_test.py": ""})
    for strict in (False, True):
        request = LaunchRequest(
            "launchtest",
            "robot",
            "drive_test.py",
            workspace=tmp_path,
            sim_time_limit=1.0,
            allows_losses=True,
            strict=strict,
        )
        folder = tmp_path / f"results{strict:d}"
        reports = ReportRequest(folder, None, junit_strict=False, verbosity="quiet", silenced=frozenset())
        with Interruption() as interruption:
            code = launch_test.run(request, reports, interruption)
        (outcome,) = json.loads((folder / "results.json").read_text())["outcomes"]
        rules = [warning["rule"] for warning in outcome["warnings"]]
        assert (code, outcome["strict"]) == (1 if strict and fails else 0, strict), outcome
        assert rules == (warned if fails or not strict else [])
        assert not warned or (warned[0] in str(outcome["notes"])) == (strict and not fails)
