"""Motions of position targets: through their points, smooth, and the same from step to step."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.state.joint_motion import Curve, JointMotion, held, resting, straight

TIMES = (0.0, 0.5, 1.25, 2.0)
numbers = st.floats(-3, 3).map(lambda value: round(value, 3))
rows = st.lists(numbers, min_size=4, max_size=4)


@pytest.mark.parametrize("kind", [Curve.through, resting, straight])
@given(rows)
def test_a_curve_goes_through_its_points_without_a_jump(
    kind: Callable[[tuple[float, ...], list[float]], Curve], values: list[float]
) -> None:
    curve = kind(TIMES, values)
    assert curve.states(np.array(TIMES))[0] == pytest.approx(values, abs=1e-9)
    assert not curve.jumps.any()
    for knot in curve.times[1:]:
        (_, before, _), (_, after, _) = curve.at(knot - 1e-9), curve.at(knot)
        # After the last knot it rests, whatever its speed was.
        assert knot == curve.times[-1] or before == pytest.approx(after, abs=1e-4)


@given(st.lists(numbers, min_size=6, max_size=6))
def test_accelerations_make_the_polynomial_that_they_were_taken_from(ascending: list[float]) -> None:
    polynomial = np.polynomial.Polynomial(ascending)
    tables = (polynomial, polynomial.deriv(), polynomial.deriv(2))
    curve = Curve.through(TIMES, *(table(np.array(TIMES)) for table in tables))
    between = np.linspace(0, 1.999, 50)
    for state, table in zip(curve.states(between), tables, strict=True):
        assert state == pytest.approx(table(between), abs=1e-8)


def test_a_curve_rests_before_its_first_knot_and_after_its_last_one() -> None:
    curve = Curve.through(TIMES, (1, 2, 3, 5), (1, 1, 1, 1))
    assert curve.at(-1.0)[:2] == (1.0, 0.0)
    assert curve.at(9.0)[:2] == (5.0, 0.0)


def test_a_straight_way_has_the_mean_speed_but_for_its_ramps() -> None:
    curve = straight((0, 2), (0, 1))
    assert curve.at(1.0) == pytest.approx((0.5, 1 / 1.98, 0.0))
    assert curve.at(0.0)[1] == curve.at(2.0)[1] == 0.0


@given(rows, st.sampled_from([200.0, 240.0, 1000.0]))
def test_velocities_of_targets_lead_from_each_position_to_the_next(values: list[float], rate: float) -> None:
    motion = JointMotion.of({"a": Curve.through(TIMES, values)})
    moments = np.arange(int(2.5 * rate) + 1) / rate
    positions, velocities, stepped = motion.targets(moments, 1 / rate)
    assert positions[1:] == pytest.approx(positions[:-1] + velocities[:-1] / rate, abs=1e-9)
    assert not stepped.any()


def test_a_jump_is_a_step_without_a_velocity() -> None:
    motion = JointMotion.of({"a": held((0, 0.5), (0, 1)), "b": straight((0, 1), (0, 1))})
    positions, velocities, stepped = motion.targets(np.arange(101) / 100, 0.01)
    assert positions[:, 0].tolist() == [0.0] * 50 + [1.0] * 50
    assert not velocities[:, 0].any()
    assert np.argwhere(stepped).tolist() == [[50, 0]]


def test_targets_stay_within_limits() -> None:
    motion = JointMotion(("a",), (straight((0, 1), (0, 2)),), lower=(-1.0,), upper=(1.5,))
    assert motion.targets(np.arange(101) / 100, 0.01)[0].max() == 1.5


def test_some_joints_keep_their_curves_and_limits() -> None:
    curves = tuple(held((0,), (value,)) for value in (1, 2, 3))
    motion = JointMotion(("a", "b", "c"), curves, lower=(0, 1, 2), upper=(5, 6, 7)).only(["c", "a"])
    assert (motion.names, motion.lower, motion.upper) == (("a", "c"), (0, 2), (5, 7))
    assert motion.extremes == ({"a": 1.0, "c": 3.0}, {"a": 1.0, "c": 3.0})


@pytest.mark.parametrize(
    ("times", "positions", "velocities", "message"),
    [
        ([], np.empty((0, 1)), None, "at least one row"),
        ([0, 0], [[0], [1]], None, "times that rise"),
        ([0, math.nan], [[0], [1]], None, "times that rise"),
        ([0, 1], [[0], [math.nan]], None, "finite positions"),
        ([0, 1], [[0, 1]], None, r"the shape \(1, 2\), not 2 rows of 1 joints"),
        ([0, 1], [[0], [1]], [[0], [math.inf]], "write NaN for one that is not known"),
    ],
)
def test_rows_that_are_no_motion_are_refused(
    times: list[float], positions: object, velocities: object, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        JointMotion.through(["a"], times, positions, velocities)  # type: ignore[arg-type]  # as a script gives them
