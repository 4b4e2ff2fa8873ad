"""Bodies in MuJoCo: how hard a robot is to turn, and what touches what without a look at each contact."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from sim_action.core.field_types import Placement
from sim_action.robot.model.robot_spec import Robot
from sim_action.world import Body, Sphere, World
from tests import traces
from tests.integration.engines import at, running, scene_of

pytest.importorskip("mujoco", reason="mujoco is not installed")
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
    from sim_action.engines.mujoco.engine import MuJoCoEngine

    ball = Body(name="ball", sphere=Sphere(radius=0.1), mass=50.0, pose=Placement(x=5.0))
    with running("mujoco", scene_of(tmp_path, ROBOT, at(z=2.0), World(objects=(ball,)))) as backend:
        assert isinstance(backend, MuJoCoEngine)
        robot = backend._pusher._robot
    assert robot.mass == pytest.approx(5.0)
    # Each link with its least moment, and the arm with its mass at 0.5 m.
    assert robot.inertia == pytest.approx(0.2 + 0.01 + 2 * 0.5**2)


def test_contacts_are_seen_however_many_there_are() -> None:
    from sim_action.engines.mujoco.engine import MuJoCoEngine

    wall = Body(name="wall", box=(0.1, 1.0, 0.2), pose=Placement(x=0.2))
    tumbling = Robot(model=traces.BURGER, pose=Placement(z=0.5, roll=1.0, pitch=0.7))
    counts, found = set(), set()
    with running("mujoco", replace(traces.scene(), robot=tumbling, world=World(objects=(wall,)))) as backend:
        assert isinstance(backend, MuJoCoEngine)
        contacts, data = backend._contacts, backend.motors._data
        for step in range(480):
            backend.advance(step, [None])
            matters = contacts.may_matter(backend._sliding.touching)
            links_and_bodies = [contacts._matters.issuperset(pair) for pair in data.contact.geom.tolist()]
            assert matters == any(links_and_bodies)
            counts.add(data.ncon)
            found.add(matters)
    assert len(counts) > 3
    assert found == {True, False}


def test_pairs_that_did_not_matter_are_remembered() -> None:
    from sim_action.engines.mujoco.engine import MuJoCoEngine

    with running("mujoco", replace(traces.scene(), world=World())) as backend:
        assert isinstance(backend, MuJoCoEngine)
        contacts, data = backend._contacts, backend.motors._data
        backend.advance(0, [None])
        assert data.ncon
        assert not contacts.may_matter(backend._sliding.touching)
        contacts._matters = set(data.contact.geom.ravel().tolist())
        assert not contacts.may_matter(backend._sliding.touching)
        contacts._harmless.clear()
        assert contacts.may_matter(backend._sliding.touching)
