"""Ramps."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from sim_action.drives.wheel_settings import ramp_towards

speeds = st.floats(-10, 10)


@given(speeds, speeds, st.floats(1e-3, 5))
def test_a_step_goes_as_far_as_it_may_and_never_past(wanted: float, value: float, most: float) -> None:
    reached = ramp_towards(wanted, value, most)
    assert abs(reached - value) <= most * (1 + 1e-9)
    assert min(wanted, value) - 1e-9 <= reached <= max(wanted, value) + 1e-9
    assert abs(abs(reached - value) - most) < 1e-9 or abs(reached - wanted) < 1e-9
