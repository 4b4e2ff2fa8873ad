"""The geometry of steering: axles meet in one point, and wheels roll about it."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sim_action.drives.ackermann import DrivenWheel, Kingpin, steered, tightest

LEFT, RIGHT = Kingpin("l", 0.5, 0.2, 1.0), Kingpin("r", 0.5, -0.2, 1.0)
BEHIND = Kingpin("b", -0.5, 0.2, 1.0)
curvatures = st.floats(-1.5, 1.5)


@given(curvatures, st.sampled_from([LEFT, RIGHT, BEHIND]))
def test_the_axle_of_a_turned_wheel_meets_the_fixed_one_amid_the_curve(curvature: float, pin: Kingpin) -> None:
    assume(abs(curvature) > 1e-3)
    angle = pin.angle(curvature)
    # The middle of the curve is on the fixed axle, 1 / curvature to the left: the axle leads from the kingpin to it.
    middle = 1 / curvature
    along_axle = (-math.sin(angle), math.cos(angle))
    to_middle = (-pin.ahead, middle - pin.left)
    assert along_axle[0] * to_middle[1] - along_axle[1] * to_middle[0] == pytest.approx(0.0, abs=1e-9 * abs(middle))


@given(curvatures, st.sampled_from([LEFT, RIGHT, BEHIND]))
def test_an_angle_tells_its_curve(curvature: float, pin: Kingpin) -> None:
    assert pin.curvature(pin.angle(curvature)) == pytest.approx(curvature, abs=1e-12)


def test_the_inner_wheel_is_turned_further() -> None:
    assert LEFT.angle(1.0) == pytest.approx(math.atan(0.5 / 0.8))
    assert RIGHT.angle(1.0) == pytest.approx(math.atan(0.5 / 1.2))


def test_the_tightest_curve_is_where_the_inner_wheel_is_at_its_limit() -> None:
    curvature = tightest((LEFT, RIGHT), 0.6)
    assert LEFT.angle(curvature) == pytest.approx(0.6)
    assert RIGHT.angle(-curvature) == pytest.approx(-0.6)
    assert RIGHT.angle(curvature) < 0.6


def test_a_wheel_in_the_middle_is_that_of_a_bicycle() -> None:
    assert tightest((Kingpin("m", 0.5, 0.0, 1.0),), 0.6) == pytest.approx(math.tan(0.6) / 0.5)


@given(curvatures, curvatures, st.floats(1e-4, 0.5))
def test_no_wheel_is_turned_faster_than_allowed_and_one_as_fast(now: float, wanted: float, most: float) -> None:
    reached = steered((LEFT, RIGHT), now, wanted, most)
    turned = [abs(pin.angle(reached) - pin.angle(now)) for pin in (LEFT, RIGHT)]
    assert max(turned) <= most * (1 + 1e-9)
    assert reached == wanted or max(turned) == pytest.approx(most)
    assert min(now, wanted) - 1e-12 <= reached <= max(now, wanted) + 1e-12


def test_wheels_roll_as_far_as_they_are_from_the_middle_of_the_curve() -> None:
    curvature = 0.8
    fixed = DrivenWheel("w", 0.1, 0.2, None)
    assert fixed.way(curvature) == pytest.approx(curvature * (1 / curvature - 0.2))
    below_pin = DrivenWheel("w", 0.1, 0.2, LEFT)
    assert below_pin.way(curvature) == pytest.approx(curvature * math.hypot(1 / curvature - 0.2, 0.5))
    # A tyre beside its kingpin stays on the wheel's axle, which leads to the middle.
    beside = DrivenWheel("w", 0.1, 0.25, LEFT)
    assert beside.way(curvature) == pytest.approx(below_pin.way(curvature) - curvature * 0.05)


def test_straight_wheels_roll_as_far_as_the_robot_goes() -> None:
    for wheel in (DrivenWheel("w", 0.1, 0.2, None), DrivenWheel("w", 0.1, 0.25, LEFT)):
        assert wheel.way(0.0) == 1.0
