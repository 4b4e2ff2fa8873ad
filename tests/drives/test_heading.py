"""Where forward is for wheels."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.drives.wheels import Wheel, heading_of, rolling, turned_forward


def wheel(ramp_towards: float, ahead: float = 0.0, left: float = 0.0, turns: int = 1) -> Wheel:
    """A wheel that rolls towards a direction in rad, at a place seen in that direction."""
    cosine, sine = math.cos(ramp_towards), math.sin(ramp_towards)
    place = (cosine * ahead - sine * left, sine * ahead + cosine * left, 0.0)
    return Wheel("w", 0.1, place, (-turns * sine, turns * cosine, 0.0))


directions = st.floats(-3.1, 3.1)
signs = st.sampled_from([1, -1])


@given(directions, signs, signs)
def test_left_and_right_tell_which_way_is_forward(ramp_towards: float, one: int, other: int) -> None:
    left, right = [wheel(ramp_towards, 0.2, 0.5, one)], [wheel(ramp_towards, 0.1, -0.5, other)]
    assert heading_of((*left, *right), left, right) == pytest.approx(ramp_towards)


@given(directions, signs)
def test_without_sides_forward_is_nearer_to_x(ramp_towards: float, turns: int) -> None:
    heading = heading_of([wheel(ramp_towards, turns=turns)])
    assert math.cos(heading) >= -1e-9
    assert math.sin(heading - ramp_towards) == pytest.approx(0.0, abs=1e-9)


@given(directions, signs)
def test_joints_that_turn_forward_roll_wheels_where_their_axes_say(ramp_towards: float, turns: int) -> None:
    heading = turned_forward([wheel(ramp_towards, left=0.5, turns=turns), wheel(ramp_towards, left=-0.5, turns=turns)])
    assert heading is not None
    there = [turns * math.cos(ramp_towards), turns * math.sin(ramp_towards)]
    assert [math.cos(heading), math.sin(heading)] == pytest.approx(there, abs=1e-8)


@given(directions)
def test_joints_that_roll_wheels_against_each_other_have_no_direction(ramp_towards: float) -> None:
    assert turned_forward([wheel(ramp_towards), wheel(ramp_towards, turns=-1)]) is None


@given(directions, st.floats(-1, 1), st.floats(-1, 1), signs)
def test_a_wheel_is_seen_in_the_direction_of_its_drive(
    ramp_towards: float, ahead: float, left: float, turns: int
) -> None:
    seen = rolling(wheel(ramp_towards, ahead, left, turns), ramp_towards)
    assert [seen.ahead, seen.left, seen.turns] == pytest.approx([ahead, left, turns])


def test_along_y_and_upright_axles() -> None:
    assert heading_of([wheel(-math.pi / 2)]) == pytest.approx(math.pi / 2)
    assert heading_of([Wheel("w", 0.1, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))]) == 0.0
