"""The geometry of pure pursuit, by hand and for any points."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sim_action.commands.pure_pursuit import Leg, Point, braking_speed, curvature_to, seen_from, turns

EAST = Leg((1.0, 2.0), (5.0, 2.0))
lengths = st.floats(-10, 10)
points = st.tuples(lengths, lengths)
legs = st.builds(Leg, points, points)
lookaheads = st.floats(0.05, 5)


@pytest.mark.parametrize(
    ("point", "closest"),
    [
        ((3.0, 4.0), (3.0, 2.0)),
        ((0.0, 2.5), (1.0, 2.0)),
        ((9.0, 9.0), (5.0, 2.0)),
        ((2.0, 2.0), (2.0, 2.0)),
    ],
    ids=["beside it", "before its start", "beyond its end", "on it"],
)
def test_the_closest_point(point: Point, closest: Point) -> None:
    assert EAST.closest(point) == pytest.approx(closest)


@given(legs, points, st.floats(0, 1))
def test_no_point_of_the_leg_is_closer(leg: Leg, point: Point, share: float) -> None:
    (x, y), (end_x, end_y) = leg.start, leg.end
    other = (x + share * (end_x - x), y + share * (end_y - y))
    assert math.dist(point, leg.closest(point)) <= math.dist(point, other) + 1e-9


@pytest.mark.parametrize(
    ("point", "lookahead", "target"),
    [
        # 3, 4, 5
        ((2.0, 2.3), 0.5, (2.4, 2.0)),
        ((2.0, 1.7), 0.5, (2.4, 2.0)),
        ((2.0, 2.0), 0.5, (2.5, 2.0)),
        ((1.0 - 0.4, 2.0), 0.5, (1.1, 2.0)),
        ((2.0, 3.0), 0.5, (2.0, 2.0)),
        ((0.0, 2.0), 0.5, (1.0, 2.0)),
        ((4.8, 2.0), 0.5, (5.0, 2.0)),
        ((6.0, 2.0), 5.0, (5.0, 2.0)),
    ],
    ids=["left", "right", "on it", "before it", "far beside it", "far before it", "near its end", "beyond its end"],
)
def test_the_lookahead_point(point: Point, lookahead: float, target: Point) -> None:
    assert EAST.lookahead_point(point, lookahead) == pytest.approx(target)


@given(legs, points, lookaheads)
def test_the_lookahead_point_is_on_the_leg_from_the_closest_one_on(leg: Leg, point: Point, lookahead: float) -> None:
    target, closest = leg.lookahead_point(point, lookahead), leg.closest(point)
    assert math.dist(leg.closest(target), target) < 1e-7
    assert math.dist(leg.start, target) >= math.dist(leg.start, closest) - 1e-9
    away = math.dist(point, target)
    # Where it is not one lookahead away, the whole leg is nearer, or all of it further.
    if away < lookahead - 1e-6:
        assert target == leg.end
    elif away > lookahead + 1e-6:
        assert target == closest


@given(points, points, lookaheads)
def test_a_leg_of_no_length_is_a_point(end: Point, point: Point, lookahead: float) -> None:
    leg = Leg(end, end)
    assert leg.closest(point) == leg.lookahead_point(point, lookahead) == end


def test_a_point_seen_from_a_robot() -> None:
    assert seen_from((1.0, 1.0), math.pi / 2, (0.0, 4.0)) == pytest.approx((3.0, 1.0))


@pytest.mark.parametrize(
    ("ahead", "left", "before_axle", "curvature"),
    [
        (1.0, 0.0, 0.0, 0.0),
        # A quarter of a circle of 2 m.
        (2.0, 2.0, 0.0, 0.5),
        (2.0, -2.0, 0.0, -0.5),
        # Half a circle of 2 m.
        (0.0, 4.0, 0.0, 0.5),
        # Its centre is 4 m to the left of an axle that is 3 m behind: 5 m away, as it is from (2, 4).
        (2.0, 4.0, 3.0, 0.25),
        (0.0, 0.0, 0.0, 0.0),
    ],
)
def test_the_curvature_of_the_arc_to_a_point(ahead: float, left: float, before_axle: float, curvature: float) -> None:
    assert curvature_to(ahead, left, before_axle) == pytest.approx(curvature)


@given(st.floats(0.01, 5), lengths, st.floats(0, 1))
def test_both_ends_of_an_arc_are_as_far_from_its_centre(ahead: float, left: float, before_axle: float) -> None:
    curvature = curvature_to(ahead, left, before_axle)
    assert math.copysign(1, curvature) == math.copysign(1, left)
    assume(abs(curvature) > 1e-3)
    centre = (-before_axle, 1 / curvature)
    assert math.dist(centre, (0.0, 0.0)) == pytest.approx(math.dist(centre, (ahead, left)))


def test_how_far_a_path_turns() -> None:
    corners = [(0.0, 0.0), (1.0, 0.0), (1.0, -1.0), (0.0, 0.0), (0.5, 0.5)]
    path = [Leg(*ends) for ends in pairwise(corners)]
    assert [math.degrees(turn) for turn in turns(path)] == pytest.approx([90.0, 135.0, 90.0])
    back = [Leg((0.0, 0.0), (-1.0, 0.1)), Leg((-1.0, 0.1), (-2.0, 0.0))]
    assert turns(back) == pytest.approx([2 * math.atan(0.1)])


def test_who_brakes_evenly_stands_still_in_time() -> None:
    """1 m/s^2 for 2 s: 2 m."""
    assert braking_speed(2.0, 1.0) == 2.0
    assert braking_speed(0.0, 1.0) == 0.0
