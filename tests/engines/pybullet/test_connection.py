"""A connection that is used again is as good as a new one, and others stay as they are."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from sim_action.scenario.loading import build_scene
from sim_action.simulation.loop import simulate
from tests.scenarios import load

pytestmark = pytest.mark.pybullet

DRIVES = """\
name: drives
robot: {model: turtlebot3_burger}
commands: {rate: 10 Hz, twist: [{linear: 0.5, angular: 0.3}]}
expect: [upright]
duration: 0.5 s
time_limit: 1 s
backend: pybullet
"""
# Other gravity, friction and rate, a solver that uses all its iterations, and a body that lies on another one.
DIFFERS = """\
name: differs
robot: {model: turtlebot3_burger, pose: {y: 2, yaw: 90 deg}}
physics: {rate: 500 Hz}
world:
  gravity: 3 m/s^2
  ground: {friction: 0.3}
  objects:
    - {name: table, box: [1, 1, 0.5], pose: {x: 2}}
    - {name: ball, sphere: {radius: 0.1}, mass: 2 kg, pose: {x: 2, z: 0.8}}
expect: [upright]
duration: 0.2 s
time_limit: 1 s
backend: pybullet
"""


@pytest.fixture(autouse=True)
def new_connections() -> Iterator[None]:
    forget()
    yield
    forget()


def forget() -> None:
    import pybullet

    from sim_action.engines.pybullet import loaded_bodies

    for client in (*loaded_bodies._RELEASED, *(each.client for each in loaded_bodies._AHEAD)):
        pybullet.disconnect(client)
    loaded_bodies._RELEASED.clear()
    loaded_bodies._AHEAD.clear()


def digest(folder: Path, text: str) -> str:
    loaded = load(folder, text)
    return simulate(loaded.scenario, build_scene(loaded), lambda _: None).digest


def test_a_run_in_a_connection_that_was_used_has_the_digest_of_a_new_one(tmp_path: Path) -> None:
    first, others = digest(tmp_path, DRIVES), []
    for _ in range(2):
        other = digest(tmp_path, DIFFERS)
        assert digest(tmp_path, DRIVES) == first
        others.append(other)
    forget()
    assert [digest(tmp_path, DIFFERS)] * 2 == others


def test_a_released_connection_is_used_again_and_others_are_left_alone() -> None:
    import pybullet

    from sim_action.engines.pybullet.loaded_bodies import connected, release

    one, two = connected(), connected()
    pybullet.createMultiBody(1, physicsClientId=one.client)
    pybullet.createMultiBody(1, physicsClientId=two.client)
    release(two.client)
    again = connected()
    assert again == two
    assert [pybullet.getNumBodies(each.client) for each in (one, again)] == [2, 1]
    release(again.client)
    release(one.client)
    assert pybullet.isConnected(again.client)
    assert not pybullet.isConnected(one.client)


def test_a_connection_that_was_closed_by_others_is_replaced() -> None:
    import pybullet

    from sim_action.engines.pybullet.loaded_bodies import connected, release

    first = connected()
    release(first.client)
    pybullet.disconnect(first.client)
    second = connected()
    assert pybullet.getNumBodies(second.client) == 1
    release(second.client)
