"""How hard MuJoCo's robots are to turn: what a push of the base has to know."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.field_types import Placement
from sim_action.world import Body, Sphere, World
from tests.integration.engines import at, running, scene_of

ROBOT = """\
<robot name="it">
  <link name="base"><inertial><mass value="3"/>
    <inertia ixx="0.2" iyy="0.3" izz="0.4" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="continuous"><parent link="base"/><child link="arm"/><origin xyz="0.3 0.4 0"/></joint>
  <link name="arm"><inertial><mass value="2"/>
    <inertia ixx="0.02" iyy="0.01" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
</robot>
"""


def test_all_of_the_robot_and_nothing_else_is_turned(tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    from sim_action.engines.mujoco.engine import MuJoCoEngine

    ball = Body(name="ball", sphere=Sphere(radius=0.1), mass=50.0, pose=Placement(x=5.0))
    with running("mujoco", scene_of(tmp_path, ROBOT, at(z=2.0), World(objects=(ball,)))) as backend:
        assert isinstance(backend, MuJoCoEngine)
        robot = backend._pusher._robot
    assert robot.mass == pytest.approx(5.0)
    # Each link with its least moment, and the arm with its mass at 0.5 m.
    assert robot.inertia == pytest.approx(0.2 + 0.01 + 2 * 0.5**2)
