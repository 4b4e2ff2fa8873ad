"""Areas of the ground with a friction of their own, on every engine."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.world import GRAVITY, Patch, World
from tests.integration.engines import BALL, CRATE, advance, at, on_every_engine, push, running, scene_of

pytestmark = on_every_engine


def slippery(friction: float) -> str:
    return CRATE.replace("<collision>", f'<contact><lateral_friction value="{friction}"/></contact><collision>')


def stopping(engine: str, folder: Path, world: World, urdf: str, speed: float, **pose: float) -> float:
    """How far a crate slides in x."""
    with running(engine, scene_of(folder, urdf, at(**pose), world, rate=1000)) as backend:
        start = advance(backend, 0, 100).base_position_xyz[-1, 0]
        push(backend, (speed, 0, 0))
        trace = advance(backend, 100, 6000)
    assert trace.speed[-1] < 2e-3
    assert abs(trace.base_position_xyz[-1, 1]) < 0.02
    return float(trace.base_position_xyz[-1, 0] - start)


ICE = World(patches=(Patch(x=2, size=(4, 2), friction=0.1), Patch(x=2, y=2, size=(4, 2), friction=3.0)))


@pytest.mark.parametrize(("x", "friction"), [(1.0, 0.1), (-4.0, 1.0)], ids=["on the patch", "off it"])
def test_a_crate_stops_as_the_friction_of_where_it_is_says(
    engine: str, x: float, friction: float, tmp_path: Path
) -> None:
    found = stopping(engine, tmp_path, ICE, slippery(0.5), 1.0, x=x)
    assert found == pytest.approx(1 / (2 * friction * 0.5 * GRAVITY), rel=0.02)


@pytest.mark.parametrize(("speed", "x"), [(0.5, -1.15), (2.0, -0.7)])
def test_the_edge_of_a_patch_is_no_step(engine: str, speed: float, x: float, tmp_path: Path) -> None:
    # The same friction on both sides of the edge at x = 0, which the slow one comes to with 0.1 mm a step.
    world = World(patches=(Patch(x=2, size=(4, 2), friction=1.0),))
    friction = speed**2 / (2 * GRAVITY * 1.0)
    found = stopping(engine, tmp_path, world, slippery(friction), speed, x=x)
    assert found == pytest.approx(1.0, rel=0.03)


def test_a_patch_is_ground_to_contacts_and_no_deeper(engine: str, tmp_path: Path) -> None:
    scene = scene_of(tmp_path, BALL, at(x=1.0), ICE)
    with running(engine, scene, contacts=True) as backend:
        assert all(overlap.depth < 1e-4 for overlap in backend.overlaps())
        trace = advance(backend, 0, 240)
        found = backend.observe(240, contacts=True)
    assert {contact.body for contact in found.contacts} == {"ground"}
    assert trace.contacts == ()
    assert found.pose.position_xyz[2] == pytest.approx(0.1, abs=1e-4)
