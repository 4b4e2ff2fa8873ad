"""What no wheel and no car has, whether a scenario says it or a plugin in the model."""

from __future__ import annotations

import dataclasses

import pytest

from sim_action.drives import recognise
from sim_action.drives.ackermann import AckermannDrive
from sim_action.drives.skid import SkidSteer
from sim_action.robot.robot_model import Plugin, RobotModel
from tests.drives.carts import cart, steered, wheel

CAR = cart(wheel("c", 0.0, 0.2), wheel("d", 0.0, -0.2), steered("a", 0.5, 0.2), steered("b", 0.5, -0.2))
DRIVE = AckermannDrive(steering=("a_steer", "b_steer"), wheels=("c", "d"))


def with_plugin(*more: tuple[str, str]) -> RobotModel:
    joints = (("left_joint", "c"), ("right_joint", "d"), ("left_steering_joint", "a_steer"))
    parameters = (*joints, ("right_steering_joint", "b_steer"), *more)
    return dataclasses.replace(CAR, plugins=(Plugin("gz-sim-ackermann-steering-system", parameters),))


@pytest.mark.parametrize(
    "more", [("steering_limit", "3.14"), ("left_steering_joint", "a_steer"), ("wheel_radius", "1e300")]
)
def test_a_plugin_that_says_what_no_car_has_is_passed_over(more: tuple[str, str]) -> None:
    drive = recognise(with_plugin(more))
    assert drive == DRIVE
    assert "ackermann" in DRIVE.describe(with_plugin(more))


@pytest.mark.parametrize(("radius", "message"), [(1e-7, "at least 1e-06 m"), (1e200, "at most 1000 m")])
def test_lengths_have_bounds(radius: float, message: str) -> None:
    drive = SkidSteer(left=("c",), right=("d",), radius=radius)
    assert (("radius",), f"must be {message}") in list(drive.problems(CAR))
