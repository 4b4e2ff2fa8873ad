"""What a joint cannot do; test_scenario_checks.py has where joints begin."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.geometry import Pose
from sim_action.robot.kinematics import beyond_limits, too_fast, too_strong
from sim_action.robot.robot_model import Joint

HINGE = Joint("j", "revolute", "a", "b", Pose(), (0, 0, 1), -1.0, 1.5707963, max_effort=10.0, max_velocity=2.0)
SLIDE = replace(HINGE, type="prismatic", lower=0.0, upper=0.04, max_velocity=0.2)
FREE = Joint("j", "continuous", "a", "b", Pose(), (0, 0, 1))


def test_what_is_beyond_a_limit_is_told_in_units_of_the_joint() -> None:
    assert beyond_limits(HINGE, 2.0) == "114.6 deg is outside the limits of the joint, -57.3 deg to 90 deg"
    assert beyond_limits(SLIDE, -0.01) == "-0.01 m is outside the limits of the joint, 0 m to 0.04 m"
    assert too_fast(HINGE, -2.5) == "143.2 deg/s is more than the joint's velocity limit, 114.6 deg/s"
    assert too_fast(SLIDE, 0.2001) == "0.2001 m/s is more than the joint's velocity limit, 0.2 m/s"
    assert too_strong(HINGE, 10.5) == "10.5 N m is more than the joint's effort limit, 10 N m"
    assert too_strong(SLIDE, -11.0) == "11 N is more than the joint's effort limit, 10 N"


@pytest.mark.parametrize("way", [1, -1])
def test_a_limit_itself_is_allowed_however_it_was_rounded(way: int) -> None:
    assert beyond_limits(HINGE, math.pi / 2) is None
    assert beyond_limits(HINGE, math.pi / 2 + 2e-6) is not None
    limited = replace(HINGE, max_velocity=1.5707963)
    assert too_fast(limited, way * math.pi / 2) is None
    assert too_fast(limited, way * math.pi / 2 * (1 + 2e-6)) is not None
    assert too_strong(HINGE, way * 10.0) is None


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_joint_without_limits_can_do_anything(value: float) -> None:
    assert (beyond_limits(FREE, value), too_fast(FREE, value), too_strong(FREE, value)) == (None, None, None)
