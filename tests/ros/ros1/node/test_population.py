"""Who is in the world: spawned, moved, reset, deleted, as data."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose, quaternion_from_rpy, rotate
from sim_action.ros.ros1.node.population import Population, SpawnedRobot, placement_of
from sim_action.world import Body, Disturbance, World

HERE, THERE, AWAY = Pose((1.0, 2.0, 0.5)), Pose((3.0, 0.0, 0.5)), Pose((-4.0, 0.0, 0.1))
ROBOT = SpawnedRobot("rover", "<robot/>", Pose())


def box(name: str, pose: Pose = HERE) -> Body:
    return Body(name=name, box=(1.0, 1.0, 1.0), pose=placement_of(pose))


def places(population: Population) -> dict[str, tuple[float, float, float | None]]:
    return {body.name: (body.pose.x, body.pose.y, body.pose.z) for body in population.world.objects}


def test_the_ground_is_the_first_of_all_models() -> None:
    assert Population(World()).names == ("ground_plane",)
    assert Population(World(objects=(box("wall"),)), ROBOT).names == ("ground_plane", "wall", "rover")


def test_what_comes_and_goes() -> None:
    one = Population(World()).with_body(box("a")).with_body(box("b"))

    assert places(one).keys() == {"a", "b"}
    assert places(one.with_body(box("a", THERE)))["a"] == THERE.position_xyz
    assert places(one.without("a")).keys() == {"b"}
    assert Population(World(), ROBOT).without("rover").robot is None


def test_all_are_at_home_again_however_often_they_were_moved() -> None:
    first = Population(World(objects=(box("wall"),)), ROBOT)
    moved = first.moved({"wall": THERE, "rover": THERE}, {"wheel": 2.0}).moved({"wall": AWAY, "rover": HERE})
    back = moved.at_home()

    assert places(moved) == {"wall": AWAY.position_xyz}
    assert moved.robot is not None
    assert (moved.robot.pose, moved.robot.joints) == (HERE, {"wheel": 2.0})
    assert places(back) == places(first)
    assert back.robot is not None
    assert (back.robot.pose, back.robot.joints) == (Pose(), {})


def test_what_comes_in_the_place_of_another_has_a_home_of_its_own() -> None:
    first = Population(World(objects=(box("wall"),)), ROBOT).moved({"wall": THERE, "rover": THERE})
    again = first.without("wall").with_body(box("wall", AWAY)).without("rover")
    later = again.moved({"wall": HERE})

    assert places(later.at_home()) == {"wall": AWAY.position_xyz}


def test_pushes_go_on_where_they_were_and_end_when_they_did() -> None:
    pushes = (Disturbance.model_validate({"at": at, "for": lasts, "force": (1.0, 0.0, 0.0)}) for at, lasts in TIMES)
    later = Population(World(disturbances=tuple(pushes)), ROBOT).later(2.0)

    left = [(push.at, push.duration) for push in later.world.disturbances]
    assert left == [(0.0, 1.0), (1.0, 1.0)]
    assert later.at_home().world.disturbances == ()


# One that is over, one that acts, one that is to come.
TIMES = ((0.0, 1.5), (1.0, 2.0), (3.0, 1.0))

ANGLES = st.floats(-math.pi, math.pi)


@given(ANGLES, ANGLES, ANGLES)
def test_a_placement_is_where_the_pose_is(roll: float, pitch: float, yaw: float) -> None:
    pose = Pose((1.0, 2.0, 3.0), quaternion_from_rpy(roll, pitch, yaw))
    placed: Placement = placement_of(pose)

    assert (placed.x, placed.y, placed.z) == (1.0, 2.0, 3.0)
    for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)):
        assert rotate(placed.orientation_xyzw, axis) == pytest.approx(rotate(pose.orientation_xyzw, axis), abs=1e-6)
