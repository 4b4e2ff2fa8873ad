"""What touches what, found without looking at contacts one by one."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sim_action.core.field_types import Placement
from sim_action.robot.model.robot_spec import Robot
from sim_action.world import Body, World
from tests import traces
from tests.integration.engines import running


def test_contacts_are_seen_however_many_there_are() -> None:
    pytest.importorskip("mujoco", reason="mujoco is not installed")
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
    pytest.importorskip("mujoco", reason="mujoco is not installed")
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
