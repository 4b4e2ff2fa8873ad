"""Contacts in the engine: what carries a robot, whatever its model says of stiffness."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.backends.pybullet import PyBulletBackend
from sim_action.models.urdf import read_urdf
from sim_action.scene import Scene
from sim_action.workspace import Workspace
from sim_action.world import Physics, Robot, World

BALL = """
<robot name="ball">
  <link name="ball">
    <inertial><mass value="1"/><inertia ixx="0.004" iyy="0.004" izz="0.004" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><sphere radius="0.1"/></geometry></collision>
    {contact}
  </link>
  {gazebo}
</robot>
"""
CARRIER = """<link name="carrier"><inertial><mass value="0.1"/>
  <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="j" type="fixed"><parent link="carrier"/><child link="ball"/></joint>"""
GRAVITY = 9.80665


@pytest.mark.parametrize("carrier", ["", CARRIER], ids=["the base", "another link"])
@pytest.mark.parametrize(
    ("contact", "gazebo", "sinks"),
    [
        ("", "<kp>0</kp>", 0.0),
        ("", "<kp>0.0</kp><kd>1.0</kd>", 0.0),
        ("", "<kd>100</kd>", 0.0),
        ('<contact><stiffness value="0"/><damping value="10"/></contact>', "", 0.0),
        ('<contact><damping value="10"/></contact>', "", 0.0),
        ('<contact><stiffness value="1000"/><damping value="50"/></contact>', "<kp>0</kp>", 0.01),
    ],
)
def test_a_stiffness_of_0_is_none(contact: str, gazebo: str, sinks: float, carrier: str, tmp_path: Path) -> None:
    tag = f'<gazebo reference="ball">{gazebo}</gazebo>{carrier}'
    (tmp_path / "robot.urdf").write_text(BALL.format(contact=contact, gazebo=tag))
    robot, model = Robot(model="robot.urdf"), read_urdf(tmp_path / "robot.urdf")
    scene = Scene(robot, model, World(), Physics(), Workspace(tmp_path, tmp_path))
    backend = PyBulletBackend(scene, contacts=False)
    try:
        backend.advance(0, [None] * 960)
        height = backend.collect().base_position_xyz[-1, 2]
    finally:
        backend.close()
    assert 0.1 - height == pytest.approx(model.mass * GRAVITY / 1000 if sinks else 0.0, abs=5e-4)
