"""Arcs: where they lead, and how points beside them go."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist
from sim_action.state.sensor_inputs import PlanarWay

ways = st.builds(PlanarWay, st.floats(-2, 2), st.floats(-2, 2), st.floats(-7, 7))


@pytest.mark.parametrize(
    ("way", "x", "y", "yaw"),
    [
        (PlanarWay(1.5, -0.5, 0.0), 1.5, -0.5, 0.0),
        (PlanarWay(math.pi / 2, 0.0, math.pi / 2), 1.0, 1.0, math.pi / 2),
        (PlanarWay(math.pi / 2, 0.0, -math.pi / 2), 1.0, -1.0, -math.pi / 2),
        (PlanarWay(0.0, math.pi, math.pi), -2.0, 0.0, math.pi),
        (PlanarWay(-2.0, 0.0, 2 * math.pi), 0.0, 0.0, 0.0),
        (PlanarWay(0.0, 0.0, 0.3), 0.0, 0.0, 0.3),
    ],
)
def test_an_arc_leads_where_it_should(way: PlanarWay, x: float, y: float, yaw: float) -> None:
    pose = way.pose()
    assert pose.position_xyz == pytest.approx((x, y, 0.0), abs=1e-12)
    assert math.remainder(pose.yaw - yaw, 2 * math.pi) == pytest.approx(0.0, abs=1e-12)


@given(ways, st.integers(2, 50))
def test_pieces_of_an_arc_add_up_to_it(way: PlanarWay, pieces: int) -> None:
    piece = PlanarWay(way.x / pieces, way.y / pieces, way.turn / pieces).pose()
    reached = Pose()
    for _ in range(pieces):
        reached = geometry.compose(reached, piece)
    assert reached.position_xyz == pytest.approx(way.pose().position_xyz, abs=1e-9)


@given(ways, st.floats(-1, 1), st.floats(-1, 1))
def test_points_of_the_same_base_go_together(way: PlanarWay, x: float, y: float) -> None:
    offset = Pose((x, y, 0.0))
    moved = geometry.compose(geometry.inverse(offset), geometry.compose(way.pose(), offset))
    found = way.of_point(x, y).pose()
    assert found.position_xyz == pytest.approx(moved.position_xyz, abs=1e-9)
    assert found.orientation_xyzw == pytest.approx(moved.orientation_xyzw)


def test_a_way_in_a_time_is_a_twist() -> None:
    assert PlanarWay(1.0, 2.0, 3.0).twist(0.5) == Twist((2.0, 4.0, 0.0), (0.0, 0.0, 6.0))
