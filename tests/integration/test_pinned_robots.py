"""A body on a path that presses a robot against something: both engines report it, and no run blows up silently."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from sim_action.core.errors import SimulationUnstable
from sim_action.simulation.loop import SimulationRun
from tests.integration.engines import on_every_engine
from tests.integration.test_bolted_contacts import ARM, BASE, INERTIAL
from tests.simulated import simulated

BLOCK = """
<robot name="block"><link name="block">
  <inertial><mass value="{mass}"/><inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><box size="0.3 0.2 0.1"/></geometry></collision>
</link></robot>
"""
WALL = {"name": "wall", "box": [0.2, 2.0, 1.0], "pose": {"x": 0.255}}
# The block is 5 mm away from the wall; the press reaches the wall but for the length of the block at x = -0.245.
FREE = -0.245


def press(squeeze: float) -> dict[str, Any]:
    xs = ((0.2, -0.4), (0.7, FREE + squeeze), (1.2, FREE + squeeze), (2.2, -0.6))
    path = [{"at": at, "x": x} for at, x in xs]
    return {"name": "press", "box": [0.2, 1.0, 0.5], "pose": {"x": -0.4}, "path": path}


def run(folder: Path, engine: str, urdf: str, *objects: dict[str, Any], **keys: Any) -> SimulationRun:
    (folder / "robot.urdf").write_text(urdf)
    asked = (
        [{"joint": {"name": "shoulder", "at_least": "-1 rad"}}] if "shoulder" in urdf else [{"travel": {"at_most": 5}}]
    )
    scenario = {"name": "s", "backend": engine, "robot": {"model": "robot.urdf"}, "world": {"objects": objects}}
    return simulated(folder, {**scenario, "expect": asked, "duration": 2, "time_limit": 2, **keys})


def block(mass: float) -> str:
    return BLOCK.format(mass=mass, i=0.01 * mass)


def pins(ran: SimulationRun) -> list[str]:
    return [note for note in ran.notes if "unlimited force" in note]


@on_every_engine
@pytest.mark.parametrize("mass", [1.0, 40.0])
def test_a_pinned_robot_is_noted_and_one_that_the_press_only_reaches_is_not(
    engine: str, mass: float, tmp_path: Path
) -> None:
    assert pins(run(tmp_path, engine, block(mass), WALL, press(0.0))) == []
    (note,) = pins(run(tmp_path, engine, block(mass), WALL, press(0.005)))
    assert note.startswith("'press' follows its path with unlimited force and pinned 'block' against 'wall', from 0.")


@on_every_engine
def test_another_robot_that_is_pinned_is_named(engine: str, tmp_path: Path) -> None:
    ego, crate = {"model": "turtlebot3_burger", "pose": {"x": 5}}, {"name": "crate", "model": "robot.urdf"}

    def pressed(squeeze: float) -> SimulationRun:
        world = {"objects": [WALL, press(squeeze)], "actors": [crate]}
        return run(tmp_path, engine, block(6.0), robot=ego, world=world)

    (note,) = pins(pressed(0.005))
    assert note.startswith("'crate': 'press' follows its path with unlimited force and pinned 'block' against 'wall'")
    assert pins(pressed(0.0)) == []
    with pytest.raises(SimulationUnstable, match=r"'crate': .*'press' follows .* squeezes 'block' against 'wall'"):
        pressed(0.06)


@on_every_engine
@pytest.mark.parametrize("squeeze", [0.06, 0.2])
@pytest.mark.parametrize("mass", [1.0, 40.0])
def test_a_crushed_robot_has_no_verdict(engine: str, mass: float, squeeze: float, tmp_path: Path) -> None:
    with pytest.raises(
        SimulationUnstable, match=r"'press' follows its path .* squeezes 'block' against 'wall' by more"
    ):
        run(tmp_path, engine, block(mass), WALL, press(squeeze))


@on_every_engine
def test_a_broken_expectation_comes_first(engine: str, tmp_path: Path) -> None:
    ran = run(tmp_path, engine, block(6.0), WALL, press(0.2), expect=["no_collision"])
    assert [verdict.status for verdict in ran.verdicts] == ["failed"]


@on_every_engine
def test_a_robot_may_be_pressed_on_the_ground(engine: str, tmp_path: Path) -> None:
    path = [{"at": 0.2, "z": 0.4}, {"at": 0.7, "z": 0.295}, {"at": 2, "z": 0.295}]
    stamp = {"name": "stamp", "box": [0.1, 0.1, 0.4], "pose": {"z": 0.4}, "path": path}
    (note,) = pins(run(tmp_path, engine, block(6.0), stamp))
    assert "'stamp' follows its path with unlimited force and pinned 'block' against the ground" in note


@on_every_engine
def test_an_arm_may_be_pressed_against_the_limits_of_its_joints(engine: str, tmp_path: Path) -> None:
    urdf = ARM.format(inertial=INERTIAL, base=BASE)
    path = [{"at": 0.2, "x": -0.6}, {"at": 1.2, "x": -0.13}, {"at": 2, "x": -0.13}]
    robot = {"model": "robot.urdf", "base": "fixed"}
    # Through the axis of the shoulder, which cannot give way.
    ram = {"name": "ram", "box": [0.2, 0.1, 0.1], "pose": {"x": -0.6, "z": 0.7}, "path": path}
    ran = run(tmp_path, engine, urdf.replace('upper="2"', 'upper="0.01"'), ram, robot=robot)
    (note,) = pins(ran)
    assert "'ram' follows its path with unlimited force and pinned 'upper' against its own joints" in note


@on_every_engine
def test_a_lift_that_starts_fast_pins_nothing(engine: str, tmp_path: Path) -> None:
    path = [{"at": 0.5, "z": 0.05}, {"at": 1.0, "z": 1.05}]
    lift = {"name": "lift", "box": [0.6, 0.6, 0.1], "pose": {"z": 0.05}, "path": path}
    robot = {"model": "robot.urdf", "pose": {"z": 0.151}}
    assert pins(run(tmp_path, engine, block(6.0), lift, robot=robot)) == []


@on_every_engine
def test_a_body_through_a_wall_is_noted(engine: str, tmp_path: Path) -> None:
    post = {"name": "post", "box": [0.1, 0.1, 1.0], "pose": {"x": -2}}
    path = [{"at": 0, "x": -3}, {"at": 1, "x": -1}]
    cart = {"name": "cart", "box": [0.4, 0.4, 0.4], "pose": {"x": -3}, "path": path}
    ran = run(tmp_path, engine, block(6.0), post, cart)
    assert any("body 'cart' passes through body 'post' on its path, at 0.40 s" in note for note in ran.notes)
