"""Curves through points: where they are at each, and how they go from one to the next."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.ros.ros1.joint_trajectory import JointCurve, Waypoint, curves

numbers = st.floats(-3, 3)


def test_without_velocities_it_goes_straight_and_rests_at_both_ends() -> None:
    curve = JointCurve((Waypoint(1.0, 0.0), Waypoint(3.0, 4.0)))

    assert curve.at(0.5) == (0.0, 0.0)
    assert curve.at(2.0) == (2.0, 2.0)
    assert curve.at(9.0) == (4.0, 0.0)


@given(ends=st.tuples(numbers, numbers, numbers, numbers), span=st.floats(0.1, 5), part=st.floats(0.01, 0.99))
def test_with_velocities_it_has_them_at_its_points_and_is_smooth_between(
    ends: tuple[float, float, float, float], span: float, part: float
) -> None:
    first, speed, last, end_speed = ends
    curve = JointCurve((Waypoint(0.0, first, speed), Waypoint(span, last, end_speed)))

    assert curve.at(1e-9) == pytest.approx((first, speed), abs=1e-4)
    assert curve.at(span - 1e-9) == pytest.approx((last, end_speed), abs=1e-4)
    before, after = (curve.at(part * span + step)[0] for step in (-1e-6, 1e-6))
    assert (after - before) / 2e-6 == pytest.approx(curve.at(part * span)[1], abs=1e-3)


def test_each_joint_has_its_own_from_where_it_is() -> None:
    start = [Waypoint(5.0, 0.1, 0.0), Waypoint(5.0, 0.2, 0.0)]
    found = curves(["a", "b"], start, [(5.0, [9.0, 9.0], []), (6.0, [1.0, 2.0], [0.0, 0.0]), (7.0, [1.5, 2.5], [])])

    assert found["b"].at(5.0)[0] == 0.2
    assert found["a"].at(6.0)[0] == 1.0
    assert found["b"].at(6.5) == (2.25, 0.5)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([(4.0, [1.0], [])], "in the past"),
        ([(6.0, [1.0], []), (6.0, [2.0], [])], "rising time"),
        ([(6.0, [1.0, 2.0], [])], "has 1 positions"),
        ([(6.0, [1.0], [1.0, 2.0])], "has 1 positions"),
    ],
)
def test_what_cannot_be(points: list[tuple[float, list[float], list[float]]], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        curves(["a"], [Waypoint(5.0, 0.0)], points)
