"""Wrenches over time: which link, in which frame, from when to when."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from sim_action.commands import OpenLoop
from sim_action.commands.wrench import WrenchCommands
from sim_action.core.workspace import Workspace
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model
from sim_action.state.command import LinkWrench
from sim_action.world import Physics, World
from sim_action.world.scene import Scene
from tests.scenarios import LEAST, load, problems
from tests.soak import examples

HERE = Workspace(Path(), Path())
ROBOT = Robot(model="turtlebot3_burger")
SCENE = Scene(ROBOT, load_model(ROBOT, HERE), World(), Physics(), HERE)


def spec(rate: Any = 40.0, **wrench: Any) -> WrenchCommands:
    return WrenchCommands.model_validate({"wrench": wrench, "rate": rate})


def given_at(commands: WrenchCommands, ticks: int, rate: float = 40.0) -> list[tuple[float, LinkWrench]]:
    """The times at which a wrench is given, and the wrench."""
    controller = commands.open(SCENE)
    assert isinstance(controller, OpenLoop)
    found = list[tuple[float, LinkWrench]]()
    for tick in range(ticks):
        answer = controller.command(tick / rate)
        assert answer is None or isinstance(answer, LinkWrench)
        found += [] if answer is None else [(tick / rate, answer)]
    return found


def test_it_begins_and_ends_once_at_ticks() -> None:
    wrench = {"link": "base_scan", "force": ("1 N", 0, "-2 kN"), "frame": "base", "point": ("10 cm", 0, 0)}
    acting = LinkWrench("base_scan", (1.0, 0.0, -2000.0), frame="base", point_xyz=(0.1, 0.0, 0.0))
    assert given_at(spec(**wrench, at="0.5 s", **{"for": "250 ms"}), 80) == [
        (0.5, acting),
        (0.75, LinkWrench("base_scan")),
    ]
    # By default it acts on the base link in the frame of the world, from the start to the end.
    assert given_at(spec(torque=(0, 0, "3 N m")), 80) == [
        (0.0, LinkWrench("base_footprint", torque_xyz=(0.0, 0.0, 3.0)))
    ]
    assert spec(force=(0, 0, 1)).begins == (("wrench", "at"), 0.0)


@examples(30)
@given(st.floats(0, 1), st.floats(0.001, 1), st.sampled_from([7.5, 10.0, 40.0, 240.0]))
def test_every_wrench_acts_for_its_duration_or_is_refused(at: float, length: float, rate: float) -> None:
    commands = spec(rate, force=(0, 0, 1), at=at, **{"for": length})
    refused = any(commands.model_problems(SCENE))
    found = given_at(commands, 600, rate)
    assert refused == ((0.0, 0.0, 1.0) not in [wrench.force_xyz for _, wrench in found])
    assert refused or [wrench.force_xyz for _, wrench in found] == [(0.0, 0.0, 1.0), (0.0, 0.0, 0.0)]
    start, end = (found[0][0], found[-1][0]) if found else (at, at + length)
    assert refused or (-1e-6 <= start - at < 1 / rate and abs(end - start - length) < 1 / rate + 1e-6)


@pytest.mark.parametrize(
    ("wrench", "message"),
    [
        ({}, "a wrench needs a 'force', a 'torque' or both"),
        ({"torque": (0, 0, 1), "point": (0, 0, 0)}, "'point' needs a 'force'"),
        ({"force": (0, 0, "1 m")}, "force"),
        ({"force": (0, 0)}, "force"),
        ({"force": (0, 0, 1), "for": 0}, "for"),
    ],
)
def test_what_does_not_fit_together_is_refused(wrench: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        spec(**wrench)


COMMANDS = LEAST[LEAST.index("commands:") : LEAST.index("expect:")]


@pytest.mark.parametrize(
    ("wrench", "line", "message"),
    [
        ("{link: base_scam, force: [0, 0, 1]}", 5, "the robot has no link 'base_scam'; did you mean 'base_scan'?"),
        ("{force: [0, 0, 1], frame: wrld}", 5, "there is no frame 'wrld': a frame is world, base, or a link"),
        ("{force: [0, 0, 1], at: 40 s}", 5, "40 s is not earlier than time_limit (30 s)"),
        ("{force: [0, 0, 1], at: 1 ms, for: 1 ms}", 5, "no tick falls between 0.001 s and 0.002 s"),
        ("{frce: [0, 0, 1]}", 5, "unknown key; did you mean 'force'?"),
        ("[{force: [0, 0, 1]}]", 5, "expected a map of keys"),
    ],
)
def test_bad_input_is_refused_at_its_line(wrench: str, line: int, message: str, tmp_path: Path) -> None:
    found = problems(tmp_path, LEAST.replace(COMMANDS, f"commands:\n  wrench: {wrench}\n"))
    assert any(message in problem.message for problem in found), found
    assert {problem.location.line for problem in found} == {line}


def test_a_fixed_base_and_a_rate_that_does_not_divide_are_refused(tmp_path: Path) -> None:
    text = LEAST.replace(COMMANDS, "commands:\n  wrench: {force: [0, 0, 1]}\n").replace(
        "  model: turtlebot3_burger\n", "  model: turtlebot3_burger\n  base: fixed\n"
    )
    messages = [problem.message for problem in problems(tmp_path, text)]
    assert any("link 'base_footprint' is fixed to the world, so nothing moves it" in each for each in messages)
    text = LEAST.replace(COMMANDS, "commands: {wrench: {force: [0, 0, 1]}, rate: 40 Hz}\nphysics: {rate: 500 Hz}\n")
    (found,) = problems(tmp_path, text)
    near = "nearest: 25 Hz and 50 Hz; or set physics: {rate: 520 Hz}"
    assert found.message == f"commands.rate: 40 Hz does not divide physics.rate, 500 Hz; {near}"


@pytest.mark.parametrize(
    ("physics", "rate"),
    [
        *((200, 40.0), (240, 40.0), (1000, 40.0), (250, 50.0), (500, 50.0), (100, 50.0), (30, 30.0), (62.5, 62.5)),
        (333, 333 / 8),
    ],
)
@pytest.mark.parametrize("command", ["wrench: {force: [0, 0, 1]", "pose: {link: tool0, waypoints: [{z: 0.4}]"])
def test_the_default_rate_divides_the_physics(command: str, physics: float, rate: float, tmp_path: Path) -> None:
    robot = "{model: turtlebot3_burger}" if "wrench" in command else "{model: ur5e_gripper}"
    text = f"name: n\nrobot: {robot}\nphysics: {{rate: {physics} Hz}}\ncommands: {{{command}}}}}\n"
    text += "expect: [{max_speed: {linear: 1}}]\ntime_limit: 1 s\nallow: [fixed-base]\n"
    (source,) = load(tmp_path, text).scenario.commands
    assert source.rate == pytest.approx(rate)
