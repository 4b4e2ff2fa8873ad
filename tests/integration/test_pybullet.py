"""What only PyBullet has: connections that are made ahead, and bolted bases that touch nothing that is fixed."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.field_types import Placement
from sim_action.robot.model.robot_spec import Robot
from sim_action.world import Body, Sphere, World
from tests.integration.engines import BALL, at, running, scene_of

pytestmark = pytest.mark.pybullet


def test_a_bolted_base_touches_what_moves_and_not_what_is_fixed(tmp_path: Path) -> None:
    wall = Body(name="wall", box=(1, 1, 1), pose=Placement(z=0.5))
    crate = Body(name="crate", box=(0.2, 0.2, 0.2), mass=1, pose=Placement(z=1.3))
    bolted = Robot(model="robot.urdf", base="fixed", pose=Placement(z=1.05))
    scene = scene_of(tmp_path, BALL, bolted, World(objects=(wall, crate)))
    with running("pybullet", scene, contacts=True) as backend:
        backend.advance(0, [None] * 240)
        assert {contact.body for contact in backend.collect().contacts} == {"crate"}


def test_a_connection_that_was_made_ahead_is_like_any_other_and_is_used_once(tmp_path: Path) -> None:
    from sim_action.engines.pybullet.engine import PyBulletEngine

    def fall() -> tuple[int, list[list[float]]]:
        world = World(objects=(Body(name="stone", sphere=Sphere(radius=0.1), mass=1, pose=Placement(x=0.15)),))
        with running("pybullet", scene_of(tmp_path, BALL, at(z=0.5), world)) as backend:
            assert isinstance(backend, PyBulletEngine)
            backend.advance(0, [None] * 240)
            return backend._client, backend.collect().state.tolist()

    PyBulletEngine.warm_up()
    PyBulletEngine.warm_up()
    with running("pybullet", scene_of(tmp_path, BALL, at())) as ahead:
        assert isinstance(ahead, PyBulletEngine)
        later, fallen = fall()
        assert later != ahead._client
        client = ahead._client
    PyBulletEngine.warm_up()
    assert fall() == (client, fallen)
