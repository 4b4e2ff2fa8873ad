"""How far any point of a robot can have come: never less than it has."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Vector3
from sim_action.engines.clearances import BodyMotionBound, RobotMotionBound, swing_per_turn
from sim_action.robot.model.robot_model import Joint, Shape
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
    bound, point = BodyMotionBound(radius), at_distance(direction, radius)
    added = [bound.advance(numbers(pose)) for pose in way]
    places = [geometry.compose(pose, Pose(point)).position_xyz for pose in way]
    for (before, after), moved in zip(pairwise(places), added[1:], strict=True):
        assert math.dist(before, after) <= moved + 1e-9
    assert added[0] == 0.0
    assert BodyMotionBound(radius).advance_all(np.array([numbers(pose) for pose in way])) == pytest.approx(added)


def test_what_stays_where_it_is_goes_nowhere_however_large_it_may_be() -> None:
    bound = BodyMotionBound(math.inf)
    there = numbers(Pose((1.0, 2.0, 3.0)))
    assert [bound.advance(there), bound.advance(there)] == [0.0, 0.0]
    turned = numbers(Pose((1.0, 2.0, 3.0), (0.0, 0.0, 1.0, 0.0)))
    assert bound.advance(turned) == math.inf
    assert BodyMotionBound(math.inf).advance_all(np.array([there, there, turned])).tolist() == [0.0, 0.0, math.inf]


def turned_wheels(shape: Shape | None) -> float:
    """How far wheels come that have this shape and turn by 2 and by -3 rad; None: nobody knows their shapes."""
    model = burger()
    wheels = [joint.child for joint in model.joints if joint.name in WHEELS]
    shapes = (shape,) if shape else ()
    links = (replace(link, collisions=shapes) if link.name in wheels else link for link in model.links)
    bound = RobotMotionBound(replace(model, links=tuple(links)), dict.fromkeys(wheels, 0.033))
    still = numbers(Pose())
    bound.advance(still, (0.0, 0.0))
    moved = bound.advance(still, (2.0, -3.0))
    assert bound.advance_all(np.array([still]), np.array([(0.0, 0.0)])) == pytest.approx([moved])
    return moved


@pytest.mark.parametrize("shape", [None, Shape("box", Pose(), upper_xyz=(0.01, 0.01, 0.01))])
def test_a_wheel_that_turns_moves_its_rim_and_only_the_farthest_counts(shape: Shape | None) -> None:
    assert math.isclose(turned_wheels(shape), 3.0 * 0.033, rel_tol=1e-6)


def test_a_wheel_that_is_round_about_its_axle_stays_where_it_is() -> None:
    (axis,) = {joint.axis_xyz for joint in burger().joints if joint.name in WHEELS}
    along = geometry.quaternion_from_rpy(-math.pi / 2, 0.0, 0.0) if axis[1] else geometry.IDENTITY
    size = (0.033, 0.033, 0.01)
    assert turned_wheels(Shape("cylinder", Pose(orientation_xyzw=along), 0.033, upper_xyz=size)) < 1e-9
    assert turned_wheels(Shape("sphere", Pose(), 0.033, upper_xyz=(0.033,) * 3)) == 0.0


@given(poses, st.tuples(angles, angles), directions, st.floats(0.01, 1), st.floats(0.01, 1))
def test_no_point_of_a_wheel_that_turns_comes_farther_away(
    mounted: Pose, turns: tuple[float, float], axis: Vector3, radius: float, half: float
) -> None:
    length = math.hypot(*axis)
    unit = (axis[0] / length, axis[1] / length, axis[2] / length)
    bound = swing_per_turn(Shape("cylinder", mounted, radius, upper_xyz=(radius, radius, half)), unit)

    def turned(angle: float) -> Pose:
        x, y, z = (part * math.sin(angle / 2) for part in unit)
        return geometry.compose(Pose(orientation_xyzw=(x, y, z, math.cos(angle / 2))), mounted)

    before, after = map(turned, turns)
    # A point of its rim, and what is nearest to it of the rim of the other.
    rim = geometry.compose(before, Pose((radius, 0.0, half))).position_xyz
    x, y, z = geometry.compose(geometry.inverse(after), Pose(rim)).position_xyz
    beyond = math.hypot(max(0.0, math.hypot(x, y) - radius), max(0.0, abs(z) - half))
    assert beyond <= bound * abs(turns[1] - turns[0]) + 1e-9


@pytest.mark.parametrize(("limits", "turned"), [((-0.5, 0.25), 0.55 * 2 * math.sqrt(2)), ((None, None), math.inf)])
def test_what_slides_is_as_far_as_its_limits_let_it(limits: tuple[float | None, float | None], turned: float) -> None:
    model = burger()
    slide = Joint("slide", "prismatic", model.root, "hand", Pose(), (1.0, 0.0, 0.0), *limits)
    hand = replace(model.links_by_name[model.root], name="hand")
    sliding = replace(model, joints=(slide,), links=(model.links_by_name[model.root], hand))
    bound = RobotMotionBound(sliding, {})
    bound.advance(numbers(Pose()), (0.0,))
    assert math.isclose(bound.advance(numbers(Pose()), (0.2,)), 0.2, rel_tol=1e-6)
    half_a_turn = Pose(orientation_xyzw=(0.0, 0.0, 1.0, 0.0))
    # Of a bound that is twice as far as need be, where a turn is half of one.
    assert math.isclose(bound.advance(numbers(half_a_turn), (0.2,)), turned, rel_tol=1e-6)
