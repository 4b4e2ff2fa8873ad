"""What a drive can do."""

from __future__ import annotations

from sim_action.robot.kinematics import Mobility


def test_who_turns_on_the_spot_has_no_turning_radius() -> None:
    assert Mobility().turns_on_the_spot
    assert Mobility().turning_radius == 0


def test_a_turning_radius_is_that_of_the_tightest_curve() -> None:
    assert not Mobility(tightest=2.0).turns_on_the_spot
    assert Mobility(tightest=2.0).turning_radius == 0.5
