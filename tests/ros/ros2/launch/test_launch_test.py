"""The robot that `create` of ros_gz_sim spawns in a launch test."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import pytest

from sim_action.core.errors import ScriptError
from sim_action.core.field_types import Placement
from sim_action.ros.ros2.bridge_link import Bridge
from sim_action.ros.ros2.launch.gazebo_programs import LeftOutProgram
from sim_action.ros.ros2.launch.launch_test import spawned_robot

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
    return spawned_robot([LeftOutProgram(CREATE, args)], cast(Bridge, Latched()), folder)


def test_a_description_from_a_topic(tmp_path: Path) -> None:
    bridge = Latched()
    programs = [
        LeftOutProgram("gz", ("sim", "empty.sdf")),
        LeftOutProgram(CREATE, ("-file", "/crate.sdf", "-name", "crate")),
        LeftOutProgram(CREATE, ("-topic", "robot_description", "-name", "bot", "--ros-args", "-r", "a:=b")),
    ]
    robot = spawned_robot(programs, cast(Bridge, bridge), tmp_path)
    assert (robot.name, robot.file.read_text(), bridge.opened) == ("bot", "<robot/>", ["/robot_description"])
    assert robot.pose == Placement()


def test_a_description_as_text_or_file_and_its_pose(tmp_path: Path) -> None:
    robot = spawn(tmp_path, "-string", "<robot name='a'/>", "-x", "1", "-y=-2", "--z", "0.5", "-Y", "3.1")
    assert robot.file.read_text() == "<robot name='a'/>"
    assert robot.pose == Placement(x=1, y=-2, z=0.5, yaw=3.1)
    assert spawn(tmp_path, "-file", "/bot.urdf").file == Path("/bot.urdf")


def test_no_robot_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ScriptError, match="spawns no robot"):
        spawned_robot([], cast(Bridge, Latched()), tmp_path)
    with pytest.raises(ScriptError, match="none of -topic, -string and -file"):
        spawn(tmp_path, "-name", "bot")
    with pytest.raises(ScriptError, match="'create -x left': this is not a number"):
        spawn(tmp_path, "-string", "<robot/>", "-x", "left")
