"""What engines tell sensors: where links are, and what rays meet; against geometry, on every engine."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.field_types import Placement
from sim_action.robot.model.robot_spec import Robot
from sim_action.state.command import JointTargets
from sim_action.world import GRAVITY, Body, Cylinder, Physics, Sphere, World
from sim_action.world.scene import Scene
from tests.integration.engines import advance, on_every_engine, running
from tests.integration.ray_oracle import Floats, first_hits
from tests.soak import examples
from tests.traces import HERE
from tests.traces import burger as burger_model

pytestmark = on_every_engine

# PyBullet stops its search within 1 mm of a surface.
TOLERANCES = {"pybullet": 1e-3, "mujoco": 1e-9}
AWAY = Robot(model="turtlebot3_burger", pose=Placement(x=500))


def burger(world: World, robot: Robot = AWAY) -> Scene:
    return Scene(robot, burger_model(), world, Physics(), HERE)


def around(generator: np.random.Generator, start: tuple[float, float, float], reach: float, count: int) -> Floats:
    """Ends of rays of one length in all directions."""
    ways = generator.normal(size=(count, 3))
    ends: Floats = np.array(start) + reach * ways / np.linalg.norm(ways, axis=1)[:, np.newaxis]
    return ends


def body(generator: np.random.Generator, number: int, size: float) -> Body:
    x, y, z, roll, pitch, yaw = generator.uniform(-1, 1, 6).tolist()
    place = Placement(x=2 * size * x, y=2 * size * y, z=size * (z + 1), roll=3 * roll, pitch=3 * pitch, yaw=3 * yaw)
    a, b, c = generator.uniform(0.02, size, 3).tolist()
    shapes: tuple[dict[str, Any], ...] = (
        {"box": (a, b, c)},
        {"sphere": Sphere(radius=a / 2)},
        {"cylinder": Cylinder(radius=a / 2, height=b)},
    )
    mass = 1.0 if generator.uniform() < 0.5 else None
    return Body(name=f"body {number}", pose=place, mass=mass, **shapes[number % 3])


@examples(20)
@given(seed=st.integers(0, 2**32 - 1))
def test_rays_end_at_the_first_surface_of_any_world(engine: str, seed: int) -> None:
    generator = np.random.default_rng(seed)
    size = float(generator.choice([0.3, 2.0, 20.0]))
    bodies = tuple(body(generator, number, size) for number in range(4))
    start = (0.0, 0.0, float(generator.uniform(0.01, size)))
    ends = around(generator, start, 4 * size, 500)
    with running(engine, burger(World(objects=bodies))) as backend:
        shares = backend.cast_rays(start, ends)
    tolerance, rounding = TOLERANCES[engine], 1e-9
    assert (shares >= first_hits(bodies, start, ends, grown=tolerance) - rounding).all()
    assert (shares <= first_hits(bodies, start, ends, grown=-tolerance) + rounding).all()
    assert (shares < np.inf).any()


def test_what_rays_begin_inside_of_is_not_met(engine: str) -> None:
    world = World(
        objects=(
            Body(name="room", box=(2, 2, 2), pose=Placement(z=1)),
            Body(name="barrel", cylinder=Cylinder(radius=0.5, height=1), pose=Placement(z=1)),
            Body(name="ball", sphere=Sphere(radius=0.3), pose=Placement(z=1)),
            Body(name="wall", box=(1, 10, 10), pose=Placement(x=4.5)),
            Body(name="thing in the room", sphere=Sphere(radius=0.1), pose=Placement(y=0.8, z=1)),
        )
    )
    ends = np.array([[10, 0, 1], [0, 10, 1], [-10, 0, 1], [0, 0, -9]], dtype=np.float64)
    with running(engine, burger(world)) as backend:
        first, again = (backend.cast_rays((0, 0, 1), ends) for _ in range(2))
        from_outside = backend.cast_rays((-3, 0, 1), ends)
    assert first.tolist() == again.tolist()
    assert first == pytest.approx([0.4, 0.07, np.inf, 0.1], abs=1e-4)
    assert from_outside[0] == pytest.approx(2 / 13, abs=1e-4)


@pytest.mark.parametrize("base", ["free", "fixed"])
def test_rays_do_not_meet_the_robot(engine: str, base: Any) -> None:
    wall = Body(name="wall", box=(0.1, 2, 1), pose=Placement(x=1))
    heights = np.linspace(0.004, 0.19, 60)
    with running(engine, burger(World(objects=(wall,)), Robot(model="turtlebot3_burger", base=base))) as backend:
        advance(backend, 0, 10)
        ahead = [backend.cast_rays((-1, 0, z), np.array([[1, 0, z], [0, 0, -z]]))[0] for z in heights]
        down = backend.cast_rays((0, 0, 2), np.array([[x, 0, -2] for x in np.linspace(-0.2, 0.2, 60)]))
    assert ahead == pytest.approx([0.975] * 60)
    assert down == pytest.approx([0.5] * 60)


def test_rays_meet_what_moves_where_it_is_now(engine: str) -> None:
    ball = Body(name="ball", sphere=Sphere(radius=0.1), pose=Placement(z=5), mass=1)
    with running(engine, burger(World(objects=(ball,)))) as backend:
        for step in range(0, 100, 20):
            height = 5 - GRAVITY / 240**2 * step * (step + 1) / 2
            (share,) = backend.cast_rays((0, 0, 10), np.array([[0.0, 0, 0]]))
            assert 10 - 10 * share == pytest.approx(height + 0.1, abs=1e-6)
            advance(backend, step, 20)


def test_many_rays_meet_what_few_do(engine: str) -> None:
    wall = Body(name="wall", box=(1, 2, 1), pose=Placement(x=1))
    ends = around(np.random.default_rng(1), (0.0, 0.0, 0.5), 3, 40_000)
    with running(engine, burger(World(objects=(wall,)))) as backend:
        every = backend.cast_rays((0, 0, 0.5), ends)
        some = backend.cast_rays((0, 0, 0.5), ends[::1000])
    assert every[::1000].tolist() == some.tolist()
    assert (every < 1).sum() > 10_000


def test_to_look_changes_nothing(engine: str) -> None:
    crates = tuple(Body(name=f"{n}", box=(0.2, 0.2, 0.2), mass=0.5, pose=Placement(x=0.3 + 0.25 * n)) for n in range(3))
    scene = burger(World(objects=crates), Robot(model="turtlebot3_burger"))
    go = JointTargets(velocity={"wheel_left_joint": 9.0, "wheel_right_joint": 8.0})
    states = []
    for looks in (False, True):
        with running(engine, scene, contacts=True) as backend:
            backend.advance(0, [go])
            for step in range(1, 480):
                if looks:
                    for link in ("base_scan", "wheel_left_link", "base_footprint"):
                        backend.link_pose(link)
                        backend.link_twist(link)
                    backend.cast_rays((0, 0, 0.1), around(np.random.default_rng(step), (0.0, 0.0, 0.1), 2, 20))
                backend.advance(step, [None])
            states.append(backend.collect())
    assert states[0].state.tobytes() == states[1].state.tobytes()
    assert states[0].contacts == states[1].contacts
    assert {contact.body for contact in states[0].contacts} == {"0"}
