"""A burger in a world of Gazebo, on every engine."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.integration.conftest import sim_action

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
