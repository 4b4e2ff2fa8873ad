"""A burger in a world of Gazebo, on every engine."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from sim_action.core.errors import InvalidScenario
from sim_action.scenario.loading import build_scene
from sim_action.world import GRAVITY
from tests.integration.conftest import sim_action
from tests.integration.engines import advance, on_every_engine, running
from tests.scenarios import load

WORLD = """<?xml version="1.0"?>
<sdf version="1.9"><world name="w">
<include><uri>model://ground_plane</uri></include>
<model name="wall"><static>true</static><pose>0.5 0 0.25 0 0 0</pose><link name="l">
  <collision name="a"><pose>0 0.3 0 0 0 0</pose><geometry><box><size>0.1 0.6 0.5</size></box></geometry></collision>
  <collision name="b"><pose>0 -0.3 0 0 0 0</pose><geometry><mesh><uri>wall.obj</uri><scale>0.1 0.6 0.5</scale></mesh>
  </geometry></collision></link></model>
<model name="post"><pose>-1 0 0 0 0 0</pose>
  <link name="foot"><pose>0 0 0.05 0 0 0</pose><inertial><mass>2</mass></inertial>
  <collision name="a"><geometry><cylinder><radius>0.2</radius><length>0.1</length></cylinder></geometry>
  </collision></link>
  <link name="top"><pose>0 0 0.3 0 0 0</pose><inertial><mass>1</mass></inertial>
  <collision name="a"><geometry><sphere><radius>0.2</radius></sphere></geometry></collision></link>
  <joint name="j" type="fixed"><parent>foot</parent><child>top</child></joint></model>
</world></sdf>
"""
CUBE = "".join(f"v {x} {y} {z}\n" for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)) + (
    "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"
)
SCENARIO = """name: a
backend: {engine}
robot: {{model: turtlebot3_burger, pose: {{y: {y}}}}}
world: {{file: w.world}}
commands: {{rate: 10 Hz, twist: [{{linear: 0.3}}]}}
expect: [{{contact: {{with: wall}}}}, {{no_collision: {{allow: [wall]}}}}]
time_limit: 3 s
"""


@pytest.mark.parametrize(("engine", "y"), [("pybullet", 0.3), ("mujoco", -0.3)])
def test_a_burger_drives_into_a_wall_of_a_world_file(engine: str, y: float, tmp_path: Path) -> None:
    (tmp_path / "w.world").write_text(WORLD)
    (tmp_path / "wall.obj").write_text(CUBE)
    (tmp_path / "a.sim.yml").write_text(SCENARIO.format(engine=engine, y=y))
    done = sim_action(tmp_path, "run", "a.sim.yml")
    assert done.returncode == 0, done.stdout + done.stderr


LOOSE = """name: a
robot: {robot}
world: {{file: w.world{more}}}
expect: [settled]
time_limit: 3 s
"""
FALLS = {"low": 0.5, "middle": 1.0, "high": 2.0}


def loose(folder: Path) -> None:
    """Write a world with a model whose links no joint joins: balls at heights in m above the ground, 5 m apart."""
    ball = "<inertial><mass>{0}</mass></inertial><collision name='c'><geometry><sphere><radius>0.1</radius></sphere>"
    links = "".join(
        f"<link name='{name}'><pose>{5 * number} 9 {height + 0.1} 0 0 0</pose>{ball.format(number + 1)}"
        "</geometry></collision></link>"
        for number, (name, height) in enumerate(FALLS.items())
    )
    (folder / "w.world").write_text(
        '<sdf version="1.9"><world name="w"><include><uri>model://ground_plane</uri></include>'
        f'<model name="balls">{links}</model></world></sdf>'
    )


@on_every_engine
def test_links_that_no_joint_joins_fall_each_as_a_free_body(engine: str, tmp_path: Path) -> None:
    """A ball falls by g t (t + dt) / 2 until it has fallen its height, and then lies on the ground."""
    loose(tmp_path)
    scene = build_scene(load(tmp_path, LOOSE.format(robot="{model: turtlebot3_burger}", more="")))
    rate = scene.physics.rate
    with running(engine, scene) as backend:
        for step in range(0, 240, 24):
            advance(backend, step, 24)
            time = (step + 24) / rate
            fallen = GRAVITY * time * (time + 1 / rate) / 2
            for name, height in FALLS.items():
                z = backend.body_pose(f"balls/{name}").position_xyz[2]
                # Bodies land within a step of the time of the fall, and then are no longer in the air.
                if abs(time - math.sqrt(2 * height / GRAVITY)) > 2 / rate:
                    at = (
                        pytest.approx(height + 0.1 - fallen, abs=2e-3)
                        if fallen < height
                        else pytest.approx(0.1, abs=0.01)
                    )
                    assert z == at, (name, time)


def test_links_that_no_joint_joins_are_no_robot(tmp_path: Path) -> None:
    loose(tmp_path)
    with pytest.raises(InvalidScenario, match=r"one root link, but it has 3: .*; connect them with fixed joints"):
        load(tmp_path, LOOSE.format(robot="{}", more=", robot: balls"))
