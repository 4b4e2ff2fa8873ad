"""The slip of wheels that are not steered, against the laws of friction worked out by hand."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.drives.skid import Footing, footings, slip_factor

sizes = st.floats(0.05, 3)


def four(wheelbase: float, mass_ahead: float = 0.0) -> list[Footing]:
    return footings([wheelbase / 2, -wheelbase / 2] * 2, mass_ahead)


@given(sizes, sizes)
def test_four_wheels_slip_by_wheelbase_over_separation_squared(wheelbase: float, separation: float) -> None:
    assert slip_factor(four(wheelbase), separation) == pytest.approx(1 + (wheelbase / separation) ** 2)


@given(sizes)
def test_two_wheels_do_not_slip(separation: float) -> None:
    assert slip_factor(footings([0.0, 0.0], 0.0), separation) == 1.0


@given(sizes, sizes, st.floats(-1, 1))
def test_friction_cancels_at_the_factor(wheelbase: float, separation: float, lean: float) -> None:
    """The work that friction does is least there: neither another turning rate nor a step aside makes it less."""
    wheels, half = four(wheelbase, 0.9 * lean * wheelbase / 2), separation / 2
    rim = half * slip_factor(wheels, separation)

    def work(turn: float, aside: float) -> float:
        return sum(w.load * math.hypot(rim - turn * half, turn * w.ahead + aside) for w in wheels)

    step = 1e-4 * wheelbase
    least = min(work(1.0, aside * wheelbase / 2000) for aside in range(-1000, 1001))
    for turn in (0.99, 1.01):
        assert min(work(turn, aside * wheelbase / 2000) for aside in range(-1000, 1001)) >= least - step


def test_what_carries_little_holds_back_little() -> None:
    even, rear_heavy = (slip_factor(four(0.5, ahead), 0.6) for ahead in (0.0, -0.1))
    assert rear_heavy < even
    assert slip_factor(four(0.5, 0.1), 0.6) == pytest.approx(rear_heavy)


def test_a_robot_that_stands_on_one_axle_alone_does_not_slip() -> None:
    assert slip_factor(four(0.5, 0.25), 0.6) == pytest.approx(1.0, abs=1e-6)


def test_middle_wheels_hold_a_short_robot_and_not_a_long_one() -> None:
    """Their grip lengthwise beats the drag of four corners as long as these are not twice half the separation away."""
    short, long = (slip_factor(footings([x, 0.0, -x] * 2, 0.0), 1.0) for x in (0.24, 0.5))
    assert short == pytest.approx(1.0)
    assert 1.0 < long < 1 + (1.0 / 1.0) ** 2


def test_loads_add_up_and_balance_where_the_mass_is() -> None:
    wheels = footings([0.5, 0.1, -0.3] * 2, 0.2)
    assert sum(wheel.load for wheel in wheels) == pytest.approx(1.0)
    assert sum(wheel.load * (wheel.ahead + 0.1) for wheel in wheels) == pytest.approx(0.2)
