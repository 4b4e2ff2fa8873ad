"""Modules that are imported before processes are forked: those that a scenario may need, and no others."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from sim_action.simulation.preloading import needed_modules
from tests.scenarios import load

DRIVEN = """\
name: burger
robot: {model: turtlebot3_burger}
commands: {twist: [{linear: 1.0}]}
expect: [{travel: {at_least: 5 cm}}]
time_limit: 3 s
"""
ON_PATH = "world: {objects: [{name: cart, box: [1, 1, 1], path: [{at: 0 s, x: 5}, {at: 1 s, x: 4}]}]}\n"
COMMANDS = "commands: {twist: [{linear: 1.0}]}\n"
EXPECTED = "expect: [{travel: {at_least: 5 cm}}]\n"
UPRIGHT = "expect: [upright: {max_tilt: 20 deg}]\nduration: 1 s\n"
BURGER = Path(__file__).parents[2] / "sim_action/robot/built_in/turtlebot3_burger.urdf"
ROVER = Path(__file__).parents[2] / "examples/drives/rover.urdf"


def needed(folder: Path, text: str) -> set[str]:
    found = needed_modules([load(folder, text)])
    assert all(find_spec(name) for name in found)
    return {name.removeprefix("sim_action.") for name in found}


def test_a_run_needs_what_its_scenario_may_need(tmp_path: Path) -> None:
    assert needed(tmp_path, DRIVEN) == set()
    assert needed(tmp_path, DRIVEN.replace(COMMANDS, "").replace(EXPECTED, UPRIGHT)) == {"simulation.energy"}
    assert needed(tmp_path, DRIVEN + ON_PATH) == {"simulation.bodies_on_paths", "simulation.tunnelling"}


def test_a_model_in_mjcf_is_read_by_each_run(tmp_path: Path) -> None:
    body = '<body><freejoint/><geom type="sphere" size="0.1" mass="1"/></body>'
    (tmp_path / "robot.xml").write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    text = DRIVEN.replace("turtlebot3_burger", "robot.xml").replace(COMMANDS, "").replace(EXPECTED, UPRIGHT)
    assert needed(tmp_path, text + "backend: mujoco\n") == {"robot.reading.mjcf.mjcf_reader"}


def test_a_model_that_needs_care(tmp_path: Path) -> None:
    urdf = BURGER.read_text(encoding="utf-8")
    assert "</joint>" in urdf
    (tmp_path / "robot.urdf").write_text(
        urdf.replace("</joint>", '<dynamics damping="0.1"/></joint>'), encoding="utf-8"
    )
    text = DRIVEN.replace("turtlebot3_burger", "robot.urdf")
    assert needed(tmp_path, text) == {"engines.pybullet.passive_joints"}
    assert needed(tmp_path, text + "backend: mujoco\n") == set()


def test_a_skid_drive_that_is_recognised_slides(tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_text(ROVER.read_text(encoding="utf-8"), encoding="utf-8")
    assert "engines.pybullet.sliding" in needed(tmp_path, DRIVEN.replace("turtlebot3_burger", "robot.urdf"))
