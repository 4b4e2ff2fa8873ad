"""Contacts in every engine: what carries a robot, whatever its model says of stiffness."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.integration.engines import advance, at, on_every_engine, running, scene_of

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


@on_every_engine
@pytest.mark.parametrize("carrier", ["", CARRIER], ids=["the base", "another link"])
@pytest.mark.parametrize(
    ("stated", "sinks"),
    [
        (("", "<kp>0</kp>"), 0.0),
        (("", "<kp>0.0</kp><kd>1.0</kd>"), 0.0),
        (("", "<kd>100</kd>"), 0.0),
        (('<contact><stiffness value="0"/><damping value="10"/></contact>', ""), 0.0),
        (('<contact><damping value="10"/></contact>', ""), 0.0),
        (('<contact><stiffness value="1000"/><damping value="50"/></contact>', "<kp>0</kp>"), 0.01),
    ],
)
def test_a_stiffness_of_0_is_none(
    engine: str, stated: tuple[str, str], sinks: float, carrier: str, tmp_path: Path
) -> None:
    contact, gazebo = stated
    tag = f'<gazebo reference="ball">{gazebo}</gazebo>{carrier}'
    scene = scene_of(tmp_path, BALL.format(contact=contact, gazebo=tag), at())
    with running(engine, scene) as backend:
        height = advance(backend, 0, 960).base_position_xyz[-1, 2]
    assert 0.1 - height == pytest.approx(scene.model.mass * GRAVITY / 1000 if sinks else 0.0, abs=5e-4)
