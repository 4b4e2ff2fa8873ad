"""Figures of drives in words."""

from __future__ import annotations

import math

from sim_action.drives.wheel_settings import heading_text, radius_text, torque_text
from tests.drives.carts import FOUR, cart
from tests.traces import WHEELS, burger


def test_only_a_heading_that_counts_is_told() -> None:
    assert heading_text(1e-5) == ""
    assert heading_text(-math.pi / 2) == ", heading -90 deg from the base's x axis"


def test_radii_that_differ_are_all_told() -> None:
    assert radius_text([0.1, 0.1]) == "wheel radius 0.1 m"
    assert radius_text([0.1, 0.2, 0.1]) == "wheel radii 0.1 m, 0.2 m"


def test_a_torque_is_the_stated_one_or_that_of_the_joints() -> None:
    assert torque_text(2.0, burger(), WHEELS) == ", torque 2 N m"
    assert torque_text(None, burger(), WHEELS) == ", torque 10 N m"
    assert torque_text(None, cart(*FOUR), ("a", "b")) == ""
