"""What is too slow to pass through anything is not searched."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.geometry import Pose
from sim_action.simulation.tunnelling import Block, Parts
from sim_action.state.trace import Trace
from sim_action.world import Body, PathPoint, World
from sim_action.world.scene import Scene
from tests.traces import burger, scene, trace

WALL = Body(name="wall", box=(0.002, 2.0, 0.5))
GATE = Body(name="gate", box=(0.01, 1.0, 1.0), path=(PathPoint(at=0.0, x=1.0), PathPoint(at=2.0, x=3.0)))
ROBOT = burger()


def within(*bodies: Body) -> Scene:
    return replace(scene(ROBOT), world=World(objects=bodies))


def moving(speeds: list[float], count: int) -> Trace:
    """The burger with these values from its velocities to those of its joints."""
    still = trace([step / 240 for step in range(1, count + 1)])
    state = still.state.copy()
    state[:, 8 : 8 + len(speeds)] = speeds
    return replace(still, state=state)


@pytest.mark.parametrize("bodies", [(WALL,), (GATE,), (WALL, GATE)])
@given(shares=st.lists(st.floats(-1, 1), min_size=10, max_size=10))
def test_a_calm_state_is_not_fast(bodies: tuple[Body, ...], shares: list[float]) -> None:
    parts = Parts(within(*bodies), solid_terrain=False)
    calm = np.minimum(parts.calm_state(), 1e4)
    assert calm.shape == (10,)
    assert (calm > 0).all()
    seen = moving((calm * shares).tolist(), 3)
    assert parts.fast_pairs(Block(seen.state[0], seen, np.empty((4, 0, 7)))) == []


@pytest.mark.parametrize("rate", [240.0, 1000.0])
def test_an_ordinary_robot_is_calm(rate: float) -> None:
    made = within(WALL.model_copy(update={"box": (0.1, 2.0, 0.5)}))
    calm = Parts(
        replace(made, physics=made.physics.model_copy(update={"rate": rate})), solid_terrain=False
    ).calm_state()
    # The burger's own limits: 0.22 m/s, 2.84 rad/s, and what its wheels turn with.
    assert (calm >= [0.22, 0.22, 0.22, 2.84, 2.84, 2.84, math.inf, math.inf, 6.7, 6.7]).all()


def test_bodies_with_a_mass_are_always_looked_at() -> None:
    ball = WALL.model_copy(update={"name": "ball", "mass": 1.0, "pose": WALL.pose})
    parts = Parts(within(WALL, ball), solid_terrain=False)
    assert (parts.calm_state() < 0).all()
    still = moving([0.0] * 10, 2)
    poses = np.tile((*Pose((9.0, 0.0, 0.0)).position_xyz, 0.0, 0.0, 0.0, 1.0), (3, 1, 1))
    assert parts.fast_pairs(Block(still.state[0], still, poses)) == []
    poses[2, 0, 0] += 0.1
    links = len(parts.links)
    found = parts.fast_pairs(Block(still.state[0], still, poses))
    assert (links, -1) in found
    assert {other for _, other in found} <= {-1, 0}
