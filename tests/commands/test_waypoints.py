"""Waypoints: what a scenario may say of them, and what it is told."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import pytest

from sim_action.commands import ClosedLoop
from sim_action.commands.waypoints import WaypointCommands
from sim_action.core.geometry import Twist
from sim_action.robot.model.kinematics import Mobility
from tests.scenarios import load, told
from tests.traces import HERE, START, scene

SCENARIO = """\
name: waypoints
robot: {{model: turtlebot3_burger}}
commands:
  waypoints: {waypoints}
  {figures}
expect: [upright]
time_limit: 1 s
"""


def spec(*points: tuple[float, float], **figures: Any) -> WaypointCommands:
    return WaypointCommands.model_validate({"waypoints": tuple({"x": x, "y": y} for x, y in points), **figures})


def first(commands: WaypointCommands, mobility: Mobility) -> Twist:
    controller = commands.open(dataclasses.replace(scene(), mobility=mobility))
    assert isinstance(controller, ClosedLoop)
    twist = controller.command(START)
    assert isinstance(twist, Twist)
    return twist


def test_figures_may_have_units_and_may_be_left_out(tmp_path: Path) -> None:
    text = SCENARIO.format(waypoints="[{x: 1, y: 0}, {x: 100 cm, y: 1}]", figures="lookahead: 25 cm")
    (source,) = load(tmp_path, text).scenario.commands
    assert source == spec((1.0, 0.0), (1.0, 1.0), lookahead=0.25)
    assert source.rate == 20.0


@pytest.mark.parametrize(
    ("waypoints", "figures", "message"),
    [
        ("[]", "", "4:3: commands.waypoints: must not be empty"),
        ("[{x: 1}]", "", "4:15: commands.waypoints.0.y: the key 'y' is missing"),
        ("[{x: 1, y: 2, z: 3}]", "", "waypoints.0.z: unknown key"),
        ("[{x: 1, y: .inf}]", "", "expected a finite length such as '1 m'"),
        ("[{x: 1, y: 1e7}]", "", "waypoints.0.y: must be at most 1,000,000 m"),
        ("[[1, 2]]", "", "waypoints.0: expected a map of keys"),
        (
            "[{x: 1, y: 2}, {x: 3, y: 2}, {x: 300 cm, y: 2}]",
            "",
            "waypoints.2: this is the same point as the one before",
        ),
        ("[{x: 1, y: 2}]", "lookahead: 0 m", "lookahead: must be greater than 0"),
        ("[{x: 1, y: 2}]", "lookahead: 4 cm", "lookahead: must not be less than tolerance (0.05 m)"),
        ("[{x: 1, y: 2}]", "tolerance: 0", "tolerance: must be greater than 0"),
        ("[{x: 1, y: 2}]", "speed: -1 m/s", "speed: must be greater than 0"),
        ("[{x: 1, y: 2}]", "speed: .nan", "expected a finite speed"),
        ("[{x: 1, y: 2}]", "max_turn_rate: 0", "max_turn_rate: must be greater than 0"),
        (
            "[{x: 1, y: 2}]",
            "speed: 2 m/s",
            (
                "speed: between two ticks the robot would drive 0.1 m, which is more than the tolerance of 0.05 m; "
                "set a rate"
            ),
        ),
        ("[{x: 1, y: 2}]", "speed: 1e300", "more than the tolerance of 0.05 m; set a larger tolerance"),
        ("[{x: 1, y: 2}]", "tolerance: 1e-320", "more than the tolerance of 1e-320 m; set a larger tolerance"),
    ],
)
def test_a_path_to_nowhere_is_refused_with_its_place(
    waypoints: str, figures: str, message: str, tmp_path: Path
) -> None:
    (problem,) = told(tmp_path, SCENARIO.format(waypoints=waypoints, figures=figures))
    assert message in problem


def test_a_path_may_come_back_to_where_it_was() -> None:
    assert list(spec((1.0, 0.0), (0.0, 1.0), (1.0, 0.0)).problems(HERE)) == []


def test_a_robot_without_wheels_cannot_follow_it(tmp_path: Path) -> None:
    (tmp_path / "box.urdf").write_text(
        '<robot name="box"><link name="base"><inertial><mass value="1"/>'
        '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link></robot>'
    )
    text = SCENARIO.format(waypoints="[{x: 1, y: 0}]", figures="").replace("turtlebot3_burger", "box.urdf")
    (problem,) = told(tmp_path, text)
    assert "it is not plain from 'box' which joints are wheels" in problem


def test_it_drives_as_the_figures_say() -> None:
    ahead = spec((2.0, 0.0), speed=0.4)
    assert first(ahead, Mobility()) == Twist.planar(0.4)
    assert first(spec((-2.0, 0.1), max_turn_rate=0.7), Mobility()) == Twist.planar(0.0, 0.7)
    assert first(spec((-2.0, 0.1)), Mobility(tightest=1.0)) == Twist.planar(0.2, 0.2 * 0.99)
    to_the_left = first(spec((0.0, 2.0)), Mobility(heading=math.pi / 2))
    assert to_the_left.linear_xyz[0] == 0.2
    assert to_the_left.angular_xyz[2] == pytest.approx(0.0)


def test_it_needs_a_drive_and_runs_no_code() -> None:
    assert WaypointCommands.needs_drive
    assert not WaypointCommands.runs_user_code
