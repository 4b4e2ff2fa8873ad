"""What a push comes to: force over what is missing, as much as is allowed, where and whither it belongs."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.geometry import Pose, Twist, quaternion_from_rpy
from sim_action.engines.body_control import RobotInertia, base_wrench
from sim_action.state.command import BasePush

ROBOT = RobotInertia(mass=4.0, inertia=0.5)
speeds = st.floats(-3, 3)


def push(ahead: float, left: float, turn: float, most: float = 1e9) -> BasePush:
    return BasePush((ahead, left), turn, (0.1, 0.0, -0.2), max_force=most, max_torque=most)


@given(st.tuples(speeds, speeds, speeds), st.tuples(speeds, speeds, speeds))
def test_unlimited_it_makes_up_for_all_that_is_missing(
    wanted: tuple[float, float, float], now: tuple[float, float, float]
) -> None:
    found = base_wrench(push(*wanted), ROBOT, Pose(), Twist((*now[:2], 1.0), (1.0, 1.0, now[2])), 0.1)
    missing = [goal - has for goal, has in zip(wanted, now, strict=True)]
    assert found.force_xyz == pytest.approx((40 * missing[0], 40 * missing[1], 0.0), abs=1e-9)
    assert found.torque_xyz == pytest.approx((0.0, 0.0, 5 * missing[2]), abs=1e-9)


@given(speeds, speeds, speeds, st.floats(0, 10))
def test_it_is_never_stronger_than_allowed_and_keeps_its_direction(
    ahead: float, left: float, turn: float, most: float
) -> None:
    whole = base_wrench(push(ahead, left, turn), ROBOT, Pose(), Twist(), 0.1)
    found = base_wrench(push(ahead, left, turn, most), ROBOT, Pose(), Twist(), 0.1)
    assert math.hypot(*found.force_xyz) <= most * (1 + 1e-9)
    assert abs(found.torque_xyz[2]) <= most
    (x, y, _), (wanted_x, wanted_y, _) = found.force_xyz, whole.force_xyz
    assert x * wanted_y == pytest.approx(y * wanted_x, abs=1e-6)
    assert x * wanted_x + y * wanted_y >= 0


def test_a_push_is_level_ahead_and_at_a_point_of_the_base() -> None:
    pose = Pose((1.0, 2.0, 0.5), quaternion_from_rpy(0.0, 0.0, math.pi / 2))
    found = base_wrench(push(1.0, 0.0, 0.0), ROBOT, pose, Twist(), 0.1)
    assert found.force_xyz == pytest.approx((0.0, 40.0, 0.0))
    assert found.point_xyz == pytest.approx((1.0, 2.1, 0.3))
    pose = Pose(orientation_xyzw=quaternion_from_rpy(0.0, 0.3, 0.0))
    assert base_wrench(push(1.0, 0.0, 0.0), ROBOT, pose, Twist(), 0.1).force_xyz == pytest.approx((40.0, 0.0, 0.0))
