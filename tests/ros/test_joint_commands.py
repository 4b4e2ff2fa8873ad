"""Curves of joint trajectories."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.ros.joint_commands import JointCurve, TrajectoryPoint, Waypoint, joint_curves

numbers = st.floats(-3, 3)


def test_without_velocities_it_goes_straight_and_rests_at_both_ends() -> None:
    curve = JointCurve((Waypoint(1.0, 0.0), Waypoint(3.0, 4.0)))
    assert curve.at(0.5) == (0.0, 0.0)
    # It has 20 ms for each change of its speed.
    assert curve.at(2.0) == pytest.approx((2.0, 4 / 1.98))
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
    points = [TrajectoryPoint(5.0, [9.0, 9.0]), TrajectoryPoint(6.0, [1.0, 2.0], [0.0, 0.0])]
    found = joint_curves(["a", "b"], start, [*points, TrajectoryPoint(7.0, [1.5, 2.5])])
    assert found["b"].at(5.0)[0] == 0.2
    assert found["a"].at(6.0)[0] == 1.0
    assert found["b"].at(6.5) == pytest.approx((2.25, 0.5 / 0.98))


_STATE = ("position", "velocity", "acceleration")


@given(ends=st.tuples(*[numbers] * 6), span=st.floats(0.2, 5))
def test_a_quintic_begins_and_ends_as_stated(ends: tuple[float, ...], span: float) -> None:
    first, last = Waypoint(0.0, *ends[:3]), Waypoint(span, *ends[3:])
    curve = JointCurve((first, last))
    for time, point in ((1e-9, first), (span - 1e-9, last)):
        found, stated = ([getattr(each, name) for name in _STATE] for each in (curve.state(time), point))
        assert found == pytest.approx(stated, abs=1e-4)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([TrajectoryPoint(4.0, [1.0])], "in the past"),
        ([TrajectoryPoint(6.0, [1.0]), TrajectoryPoint(6.0, [2.0])], "do not increase"),
        ([TrajectoryPoint(6.0, [1.0, 2.0])], "needs 1 positions"),
        ([TrajectoryPoint(6.0, [1.0], [1.0, 2.0])], "needs 1 positions"),
        ([TrajectoryPoint(6.0, [1.0], [1.0], [1.0, 2.0])], "needs 1 positions"),
    ],
)
def test_what_cannot_be(points: list[TrajectoryPoint], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        joint_curves(["a"], [Waypoint(5.0, 0.0)], points)
