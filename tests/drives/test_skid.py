"""Skid steer: recognition, slip, and what it makes of a twist."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest
from pydantic import ValidationError

from sim_action.core.geometry import Twist, Vector3
from sim_action.drives import recognise
from sim_action.drives.skid import SkidSteer
from sim_action.robot.robot_model import Plugin, RobotModel
from sim_action.state.command import JointTargets
from tests.drives.carts import FOUR, RADIUS, cart, steered, wheel

SKID = SkidSteer(left=("a", "b"), right=("c", "d"))
SLIP = 1 + (0.4 / 0.6) ** 2
ALONG_X: Vector3 = (1.0, 0.0, 0.0)


def targets(drive: SkidSteer, twist: Twist, model: RobotModel | None = None) -> JointTargets:
    (planned,) = drive.open(model or cart(*FOUR), 0.01).targets(twist, 1)
    return planned


def test_wheels_on_both_sides_are_recognised() -> None:
    assert recognise(cart(*FOUR)) == SKID


def test_six_wheels_are_recognised() -> None:
    six = cart(*FOUR, wheel("e", 0.0, 0.3), wheel("f", 0.0, -0.3))
    assert recognise(six) == SkidSteer(left=("a", "b", "e"), right=("c", "d", "f"))


def test_wheels_whose_axes_point_the_other_way_are_recognised_and_turned_the_other_way() -> None:
    model = cart(*FOUR[:3], wheel("d", -0.2, -0.3, axis=(0.0, -1.0, 0.0)))
    assert recognise(model) == SKID
    assert targets(SKID, Twist.planar(1.0), model).velocity["d"] == pytest.approx(-10.0)


def test_wheels_that_roll_along_y_are_recognised_by_the_names_of_their_sides() -> None:
    places = {"left_1": (-0.3, 0.2), "left_2": (-0.3, -0.2), "right_1": (0.3, 0.2), "right_2": (0.3, -0.2)}
    model = cart(*(wheel(name, *place, axis=ALONG_X) for name, place in places.items()))
    drive = recognise(model)
    assert drive == SkidSteer(left=("left_1", "left_2"), right=("right_1", "right_2"))
    assert "heading 90 deg" in drive.describe(model)


@pytest.mark.parametrize(
    "model",
    [
        cart(*FOUR[:3], wheel("d", -0.2, 0.0)),
        cart(*FOUR[:3], wheel("d", -0.2, -0.3, axis=ALONG_X)),
        cart(*FOUR[:3]),
        cart(*FOUR[:3], steered("d", -0.2, -0.3)),
        cart(*(wheel(name, x, y, axis=ALONG_X) for name, x, y in (("a", 1, 1), ("b", 1, -1), ("c", -1, 1)))),
        cart(*(wheel(f"{side}_{x}", x, y) for x in (1, -1) for side, y in (("left", -1), ("right", 1)))),
        cart(*FOUR[:3], wheel("d", -0.2, -0.3, radius=None)),
    ],
    ids=["amid", "across", "three", "steered", "no sides", "names that contradict", "no radius"],
)
def test_what_is_not_plain_is_not_recognised(model: RobotModel) -> None:
    assert recognise(model) is None


def plugin(name: str, *parameters: tuple[str, str]) -> RobotModel:
    return dataclasses.replace(cart(*FOUR), plugins=(Plugin(name, parameters),))


@pytest.mark.parametrize(
    "model",
    [
        plugin(
            "gazebo_ros_skid_steer_drive",
            ("leftFrontJoint", "a"),
            ("rightFrontJoint", "c"),
            ("leftRearJoint", "b"),
            ("rightRearJoint", "d"),
            ("wheelSeparation", "0.9"),
            ("wheelDiameter", "0.22"),
            ("torque", "20"),
        ),
        plugin(
            "gz-sim-diff-drive-system",
            ("left_joint", "a"),
            ("left_joint", "b"),
            ("right_joint", "c"),
            ("right_joint", "d"),
            ("wheel_separation", "0.9"),
            ("wheel_radius", "0.11"),
            ("max_wheel_torque", "20"),
        ),
    ],
    ids=["ROS 1", "gz"],
)
def test_what_a_plugin_says_is_taken_with_a_separation_that_is_in_effect(model: RobotModel) -> None:
    stated = SKID.model_copy(update={"separation": 0.9, "radius": 0.11, "torque": 20.0, "slip": 1.0})
    assert recognise(model) == stated


def test_a_plugin_without_a_separation_leaves_the_slip_to_the_model() -> None:
    parameters = (("left_joint", "a"), ("left_joint", "b"), ("right_joint", "c"), ("right_joint", "d"))
    assert recognise(plugin("gazebo_ros_diff_drive", *parameters)) == SKID


def test_forward_is_as_any_wheels_roll() -> None:
    assert list(targets(SKID, Twist.planar(0.5)).velocity.values()) == pytest.approx([0.5 / RADIUS] * 4)


@pytest.mark.parametrize(("slip", "factor"), [(None, SLIP), (1.0, 1.0), (2.0, 2.0)])
def test_turning_takes_rims_that_are_faster_by_the_slip(slip: float | None, factor: float) -> None:
    drive = SKID.model_copy(update={"slip": slip})
    rim = factor * 0.3 / RADIUS
    assert list(targets(drive, Twist.planar(0.0, 1.0)).velocity.values()) == pytest.approx([-rim, -rim, rim, rim])


def test_where_the_mass_is_counts() -> None:
    forward, rearward = (SKID.slip_factor(cart(*FOUR, mass_ahead=ahead)) for ahead in (0.1, -0.1))
    assert forward == pytest.approx(rearward)
    assert forward < SLIP


def test_a_description_says_the_slip_and_where_it_is_from() -> None:
    assert SKID.describe(cart(*FOUR)) == (
        "skid steer: left a, b; right c, d; wheel radius 0.1 m, separation 0.6 m x slip 1.444 (worked out from where "
        "the wheels and the mass are), rotors 0.05 kg m^2 (assumed), acceleration 1 m/s^2"
    )
    stated = SKID.model_copy(update={"slip": 1.5, "rotor_inertia": 0.2})
    assert "x slip 1.5, rotors 0.2 kg m^2, acc" in stated.describe(cart(*FOUR))


@pytest.mark.parametrize(("stated", "inertia"), [(None, 0.5 * 10.0 * RADIUS**2), (0.0, 0.0), (0.3, 0.3)])
def test_its_motors_have_rotors(stated: float | None, inertia: float) -> None:
    drive = SKID.model_copy(update={"rotor_inertia": stated})
    assert drive.rotors(cart(*FOUR)) == {name: pytest.approx(inertia) for name in "abcd"}


@pytest.mark.parametrize("spec", [{"slip": 0}, {"slip": -1}, {"rotor_inertia": -1}, {"left": []}, {"slips": 1}])
def test_drives_that_cannot_be_are_refused(spec: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        SkidSteer.model_validate({"left": ("a",), "right": ("b",), **spec})
