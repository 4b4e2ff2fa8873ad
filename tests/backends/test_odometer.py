"""How far any point of a robot can have come: never less than it has."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action import geometry
from sim_action.backends.odometer import Odometer, PoseOdometer
from sim_action.geometry import Pose, Vector3
from sim_action.robot_model import Joint
from tests.traces import WHEELS, burger

angles = st.floats(-math.pi, math.pi)
small = st.floats(-2, 2)
poses = st.builds(
    lambda place, turn: Pose(place, geometry.quaternion_from_rpy(*turn)),
    st.tuples(small, small, small),
    st.tuples(angles, angles, angles),
)
directions = st.tuples(small, small, small).filter(lambda way: math.hypot(*way) > 0.1)


def numbers(pose: Pose) -> tuple[float, ...]:
    return (*pose.position_xyz, *pose.orientation_xyzw)


def at_distance(direction: Vector3, radius: float) -> Vector3:
    length = math.hypot(*direction)
    x, y, z = direction
    return (x * radius / length, y * radius / length, z * radius / length)


@given(st.lists(poses, min_size=2, max_size=5), directions, st.floats(0, 3))
def test_no_point_of_a_body_comes_farther(way: list[Pose], direction: Vector3, radius: float) -> None:
    odometer, point = PoseOdometer(radius), at_distance(direction, radius)
    added = [odometer.advance(numbers(pose)) for pose in way]
    places = [geometry.compose(pose, Pose(point)).position_xyz for pose in way]
    for (before, after), moved in zip(pairwise(places), added[1:], strict=True):
        assert math.dist(before, after) <= moved + 1e-9
    assert odometer.way >= sum(added)
    assert added[0] == 0.0


def test_what_stays_where_it_is_goes_nowhere_however_large_it_may_be() -> None:
    odometer = PoseOdometer(math.inf)
    there = numbers(Pose((1.0, 2.0, 3.0)))
    assert [odometer.advance(there), odometer.advance(there), odometer.way] == [0.0, 0.0, 0.0]
    assert odometer.advance(numbers(Pose((1.0, 2.0, 3.0), (0.0, 0.0, 1.0, 0.0)))) == math.inf


def test_a_wheel_that_turns_moves_its_rim_and_only_the_farthest_counts() -> None:
    model = burger()
    odometer = Odometer(model, {joint.child: 0.033 for joint in model.joints if joint.name in WHEELS})
    still = numbers(Pose())
    odometer.advance(still, (0.0, 0.0))
    assert math.isclose(odometer.advance(still, (2.0, -3.0)), 3.0 * 0.033, rel_tol=1e-6)


@pytest.mark.parametrize(("limits", "turned"), [((-0.5, 0.25), 0.55 * 2 * math.sqrt(2)), ((None, None), math.inf)])
def test_what_slides_is_as_far_away_as_its_limits_let_it(
    limits: tuple[float | None, float | None], turned: float
) -> None:
    model = burger()
    slide = Joint("slide", "prismatic", model.root, "hand", Pose(), (1.0, 0.0, 0.0), *limits)
    hand = replace(model.links_by_name[model.root], name="hand")
    sliding = replace(model, joints=(slide,), links=(model.links_by_name[model.root], hand))
    odometer = Odometer(sliding, {})
    odometer.advance(numbers(Pose()), (0.0,))
    assert math.isclose(odometer.advance(numbers(Pose()), (0.2,)), 0.2, rel_tol=1e-6)
    half_a_turn = Pose(orientation_xyzw=(0.0, 0.0, 1.0, 0.0))
    # Of a bound that is twice as far as need be, where a turn is half of one.
    assert math.isclose(odometer.advance(numbers(half_a_turn), (0.2,)), turned, rel_tol=1e-6)
