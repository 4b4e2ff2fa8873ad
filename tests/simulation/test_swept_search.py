"""The frames of links at many moments, the bounds on their motion, and the sizes of convex pieces."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.geometry import Pose, Vector3, compose, quaternion_from_rpy
from sim_action.core.lazy_numpy import FloatArray
from sim_action.engines.clearances import motion_factors
from sim_action.robot.model.kinematics import frames_of, link_frames, link_poses
from sim_action.robot.model.robot_model import Joint, Link, RobotModel, Shape
from sim_action.simulation.convex_pieces import Obstacle, link_pieces, part_pieces, part_soups
from sim_action.simulation.fast_motion import Block, Parts
from sim_action.simulation.swept_search import _is_driven
from sim_action.state.trace import Trace
from sim_action.state.trace_records import ALWAYS
from sim_action.world import Body, PathPoint, World
from sim_action.world.parts import BoxPart, CylinderPart, GridPart, SpherePart, SurfacePart
from sim_action.world.scene import Scene
from tests import traces
from tests.traces import burger, scene, trace

ROD: Final = Shape("box", Pose((0.2, 0.0, 0.0)), None, (-0.2, -0.01, -0.02), (0.2, 0.01, 0.02))
ROUND: Final = Shape("cylinder", Pose(), 0.1, (-0.1, -0.1, -0.02), (0.1, 0.1, 0.02))
MODEL: Final = RobotModel(
    "arm",
    str(Path("arm.urdf")),
    (Link("base", 1.0, (ROD,)), Link("upper", 1.0, (ROD,)), Link("slide", 1.0, (ROD,)), Link("wheel", 1.0, (ROUND,))),
    (
        Joint("a", "continuous", "base", "upper", Pose((0.1, 0, 0.2), quaternion_from_rpy(0.3, 0, 1)), (0, 1, 0)),
        Joint("b", "prismatic", "upper", "slide", Pose((0.4, 0, 0)), (1, 0, 0), -0.3, 0.3),
        Joint("c", "continuous", "slide", "wheel", Pose((0.1, 0.05, 0)), (0, 0, 1)),
    ),
    "",
)
numbers = st.floats(-3, 3)
SLIDES: Final = st.floats(-0.3, 0.3)


@given(numbers, SLIDES, numbers, st.tuples(numbers, numbers, numbers), st.tuples(numbers, numbers, numbers))
def test_frames_are_those_of_one_moment(
    a: float, b: float, c: float, at: tuple[float, float, float], rpy: tuple[float, float, float]
) -> None:
    base = Pose(at, quaternion_from_rpy(*rpy))
    frames = link_frames(
        MODEL, frames_of(np.array([at, at]), np.array([base.orientation_xyzw] * 2)), np.array([[a, b, c]] * 2)
    )
    for link, pose in link_poses(MODEL, {"a": a, "b": b, "c": c}).items():
        expected, found = compose(base, pose), frames[link]
        assert [float(np.ravel(x)[-1]) for x in found.position_xyz] == pytest.approx(expected.position_xyz, abs=1e-9)
        turns = [float(np.ravel(x)[-1]) for x in found.orientation_xyzw]
        assert abs(np.dot(turns, expected.orientation_xyzw)) == pytest.approx(1)


@given(st.tuples(numbers, SLIDES, numbers), st.tuples(numbers, st.floats(-1, 1), numbers), numbers)
def test_no_point_of_a_link_moves_faster_than_its_factors_say(
    joints: tuple[float, float, float], speeds: tuple[float, float, float], yaw_rate: float
) -> None:
    step = 1e-4
    reach = {link.name: 0.5 if link.name != "wheel" else math.hypot(0.1, 0.1, 0.02) for link in MODEL.links}
    factors = motion_factors(MODEL, reach)
    positions = np.array([joints, np.add(joints, np.multiply(speeds, step))])
    turns = np.array([quaternion_from_rpy(0.2, 0.0, turn) for turn in (0.0, yaw_rate * step)])
    places = np.array([(0.0, 0.0, 0.0), (2.0 * step, 0.0, 0.0)])
    frames = link_frames(MODEL, frames_of(places, turns), positions)
    for link in MODEL.links:
        (piece,) = link_pieces(link.collisions)
        ends = [
            np.array([compose(pose, Pose(at)).position_xyz for at in corners(piece.points)])
            for pose in moments(frames[link.name])
        ]
        moved = float(np.sqrt(np.square(ends[1] - ends[0]).sum(axis=1)).max()) / step
        bound = float(factors[link.name].ways @ np.abs([2.0, yaw_rate, *speeds]))
        if link.name == "wheel":
            # It is round: its points move about its axis, but its surface stays in its place.
            bound += 0.15 * abs(speeds[2])
        assert moved <= bound * 1.001 + 1e-9


def corners(points: FloatArray) -> list[Vector3]:
    return [(x, y, z) for x, y, z in points.tolist()]


def moments(frames: Pose) -> list[Pose]:
    """The poses of both moments."""
    columns: Any = (*frames.position_xyz, *frames.orientation_xyzw)
    rows = np.column_stack([np.broadcast_to(column, 2) for column in columns]).tolist()
    return [Pose((x, y, z), (i, j, k, w)) for x, y, z, i, j, k, w in rows]


def test_a_round_wheel_does_not_move_its_surface_about_its_axis() -> None:
    factors = motion_factors(MODEL, dict.fromkeys(("wheel", "slide"), 0.5))["wheel"]
    assert factors.ways[4] == pytest.approx(0, abs=1e-9)
    assert factors.turns.tolist() == [0, 1, 1, 0, 0]


def test_pieces_know_their_width_and_extents() -> None:
    box, cylinder, ball = part_pieces((BoxPart((1.0, 0.5, 0.002)), CylinderPart(0.1, 0.5), SpherePart(0.2)))
    assert [piece.width for piece in (box, cylinder, ball)] == pytest.approx([0.002, 0.2, 0.4])
    along = np.array([[1.0, 0, 0], [0, 0, 1.0]])
    assert box.extents(along) == pytest.approx([1.0, 0.002])
    assert cylinder.extents(along) == pytest.approx([0.2, 0.5])
    assert ball.extents(along) == pytest.approx([0.4, 0.4])
    assert ball.is_ball


def test_an_obstacle_finds_what_is_near_and_there() -> None:
    surface = SurfacePart(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array([[0, 1, 2], [0, 1, 3]]))
    hills = GridPart((2.0, 2.0), np.zeros((3, 3)))
    made = Obstacle.of(
        [
            ("box", (5.0, math.inf), Pose((10.0, 0, 0)), tuple(part_pieces((BoxPart((1.0, 1, 1)),))), ()),
            ("mesh", ALWAYS, Pose(), (), tuple(part_soups((surface,), is_solid=True))),
            ("hills", ALWAYS, Pose((0.0, 0, 5)), (), tuple(part_soups((hills,), is_solid=True))),
        ]
    )

    def near(x: float, z: float, step: int) -> list[str]:
        at = np.array([x, 0.1, z])
        return [made.names[made.bodies[index]] for index in made.near(at - 0.05, at + 0.05, step)]

    assert near(10.4, 0.0, 4) == []
    assert near(10.4, 0.0, 5) == ["box"]
    assert near(0.5, 0.0, 0) == ["mesh"]
    assert set(near(0.5, 4.95, 0)) == {"hills"}
    assert made.corners(1).shape == (3, 3)
    assert made.corners(3).shape == (6, 3)
    assert made.least_thickness == 0.0


def test_a_step_in_which_the_base_was_set_elsewhere_is_no_motion() -> None:
    before = Trace.of_observation(traces.START).state[0]
    there = traces.trace([0.1, 0.2, 0.3], x=[0.0, 5.0, 5.0])
    assert _is_driven(Block(before, there, np.zeros((4, 0, 7)))).tolist() == [True, False, True]
    # The first step of a block is compared with the last one of the block before.
    assert _is_driven(Block(there.state[0], there.rows(slice(1, 3)), np.zeros((3, 0, 7)))).tolist() == [False, True]


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
