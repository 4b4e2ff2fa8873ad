"""Skid steer: recognition, slip, and what it makes of a twist."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from sim_action.core.geometry import Twist, Vector3
from sim_action.drives import recognise
from sim_action.drives.skid import Footing, SkidSteer, footings, slip_factor
from sim_action.robot.model.robot_model import RobotModel, Surface
from sim_action.state.command import JointTargets
from sim_action.world import World
from sim_action.world.scene import Scene
from tests import traces
from tests.drives.carts import FOUR, RADIUS, Part, asking, cart, steered, wheel

SKID = SkidSteer(left=("a", "b"), right=("c", "d"))
SIX = SkidSteer(left=("a", "b", "e"), right=("c", "d", "f"))
SIX_WHEELS = (*FOUR, wheel("e", 0.0, 0.3), wheel("f", 0.0, -0.3))
# Of wheels without a width, 0.4 m and 0.6 m apart.
NARROW = 1 + (0.4 / 0.6) ** 2
SLIP = slip_factor(footings([0.2, -0.2] * 2, 0.0, [0.04] * 4), 0.6)
SIDES = "left_joint=a,b right_joint=c,d"  # parameters of a plugin
CORNERS = "leftFrontJoint=a rightFrontJoint=c leftRearJoint=b rightRearJoint=d"
ALONG_X: Vector3 = (1.0, 0.0, 0.0)


def targets(drive: SkidSteer, twist: Twist, model: RobotModel | None = None) -> JointTargets:
    (planned,) = drive.open(model or cart(*FOUR), 0.01).targets(twist, 1)
    return planned


@pytest.mark.parametrize(("drive", "wheels"), [(SKID, FOUR), (SIX, SIX_WHEELS)])
def test_wheels_on_both_sides_are_recognised(drive: SkidSteer, wheels: tuple[Part, ...]) -> None:
    assert recognise(cart(*wheels)) == drive


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


@pytest.mark.parametrize(
    ("plugin", "parameters", "torque"),
    [
        ("gazebo_ros_skid_steer_drive", f"{CORNERS} wheelSeparation=0.9 wheelDiameter=0.22 torque=20", 20.0),
        ("gz-sim-diff-drive-system", f"{SIDES} wheel_separation=0.9 wheel_radius=0.11", None),
    ],
)
def test_what_a_plugin_says_is_taken_with_a_separation_that_is_in_effect(
    plugin: str, parameters: str, torque: float | None
) -> None:
    stated = SKID.model_copy(update={"separation": 0.9, "radius": 0.11, "torque": torque, "slip": 1.0})
    assert recognise(asking(cart(*FOUR), plugin, parameters)) == stated


def test_a_plugin_without_a_separation_leaves_the_slip_to_the_model() -> None:
    assert recognise(asking(cart(*FOUR), "gazebo_ros_diff_drive", SIDES)) == SKID


@pytest.mark.parametrize(("slip", "factor"), [(None, SLIP), (1.0, 1.0), (2.0, 2.0)])
def test_turning_takes_rims_that_are_faster_by_the_slip(slip: float | None, factor: float) -> None:
    drive = SKID.model_copy(update={"slip": slip})
    rim = factor * 0.3 / RADIUS
    assert list(targets(drive, Twist.planar(0.0, 1.0)).velocity.values()) == pytest.approx([-rim, -rim, rim, rim])


def test_where_the_mass_is_counts() -> None:
    forward, rearward = (SKID.slip_factor(cart(*FOUR, mass_ahead=ahead)) for ahead in (0.1, -0.1))
    assert forward == pytest.approx(rearward)
    assert forward < NARROW < SLIP


def test_a_description_says_the_slip_and_where_it_is_from() -> None:
    assert SKID.describe(cart(*FOUR)) == (
        "skid steer: left a, b; right c, d; wheel radius 0.1 m, separation 0.6 m x slip 1.451 (computed from "
        "the wheels and the centre of mass), acceleration 1 m/s^2"
    )
    stated = SKID.model_copy(update={"slip": 1.5, "rotor_inertia": 0.2})
    assert "x slip 1.5, rotors 0.2 kg m^2, acc" in stated.describe(cart(*FOUR))


def prepared(drive: SkidSteer, model: RobotModel, gravity: float = 9.80665) -> Scene:
    world = World(gravity=(0.0, 0.0, -gravity))
    return drive.prepared(dataclasses.replace(traces.scene(), model=model, world=world))


@pytest.mark.parametrize("stated", [None, 0.0, 0.3])
def test_motors_have_the_rotors_that_are_stated(stated: float | None) -> None:
    drive = SKID.model_copy(update={"rotor_inertia": stated})
    assert prepared(drive, cart(*FOUR)).rotors == (dict.fromkeys("abcd", stated) if stated else {})


@pytest.mark.parametrize(("drive", "wheels"), [(SKID, FOUR), (SIX, SIX_WHEELS)])
def test_wheels_have_tyres_that_give_way_a_little_under_the_weight(drive: SkidSteer, wheels: tuple[Part, ...]) -> None:
    scene = prepared(drive, cart(*wheels))
    links = scene.model.links_by_name
    assert scene.scrubbing == {f"{name}_link" for name in (*drive.left, *drive.right)}
    for name in scene.scrubbing:
        surface, mass = links[name].surface, scene.model.mass / len(wheels)
        assert surface.stiffness == pytest.approx(mass * 9.80665 / 0.00025)
        assert surface.stiffness is not None
        assert surface.damping == pytest.approx(4 * math.sqrt(surface.stiffness * mass))
    assert links["base"].surface.stiffness is None


def test_wheels_are_not_stiffer_than_tyres_even_if_the_model_says_so() -> None:
    model = cart(*FOUR)
    stiff = tuple(
        dataclasses.replace(link, surface=Surface(0.8, 1e8, 1.0)) if link.name != "base" else link
        for link in model.links
    )
    expected = {name: link.surface for name, link in prepared(SKID, model).model.links_by_name.items()}
    found = prepared(SKID, dataclasses.replace(model, links=stiff)).model.links_by_name
    for name in ("a_link", "b_link", "c_link", "d_link"):
        assert found[name].surface == dataclasses.replace(expected[name], friction=0.8)


def test_stated_tyres_stay_and_without_gravity_there_are_none() -> None:
    model = cart(*FOUR)
    own = Surface(1.0, 5e4, 100.0)
    links = tuple(dataclasses.replace(link, surface=own) if link.name == "a_link" else link for link in model.links)
    found = prepared(SKID, dataclasses.replace(model, links=links)).model.links_by_name
    assert found["a_link"].surface == own
    assert found["b_link"].surface.stiffness
    weightless = prepared(SKID, model, gravity=0.0).model.links_by_name
    assert weightless["a_link"].surface.stiffness is None


@pytest.mark.parametrize("spec", [{"slip": 0}, {"slip": -1}, {"rotor_inertia": -1}, {"left": []}, {"slips": 1}])
def test_drives_that_cannot_be_are_refused(spec: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        SkidSteer.model_validate({"left": ("a",), "right": ("b",), **spec})


sizes = st.floats(0.05, 3)


def four(wheelbase: float, mass_ahead: float = 0.0, width: float = 0.0) -> list[Footing]:
    return footings([wheelbase / 2, -wheelbase / 2] * 2, mass_ahead, [width] * 4)


@given(sizes, sizes)
def test_four_wheels_slip_by_wheelbase_over_separation_squared_and_two_do_not(
    wheelbase: float, separation: float
) -> None:
    assert slip_factor(footings([0.0, 0.0], 0.0), separation) == 1.0
    assert slip_factor(four(wheelbase), separation) == pytest.approx(1 + (wheelbase / separation) ** 2)


@given(sizes, sizes, st.floats(-1, 1), st.floats(0, 0.5))
def test_friction_cancels_at_the_factor(wheelbase: float, separation: float, lean: float, wide: float) -> None:
    """The work that friction does is least there: neither another turning rate nor a step aside makes it less."""
    wheels, half = four(wheelbase, 0.9 * lean * wheelbase / 2, wide * separation), separation / 2
    rim = half * slip_factor(wheels, separation)

    def work(turn: float, aside: float) -> float:
        return sum(
            w.load / 2 * math.hypot(rim - turn * (half + way * w.width / 2), turn * w.ahead + aside)
            for w in wheels
            for way in (-1, 1)
        )

    step = 1e-4 * wheelbase
    least = min(work(1.0, aside * wheelbase / 2000) for aside in range(-1000, 1001))
    for turn in (0.99, 1.01):
        assert min(work(turn, aside * wheelbase / 2000) for aside in range(-1000, 1001)) >= least - step


def test_wide_wheels_slip_more_and_those_that_carry_little_hold_back_little() -> None:
    narrow, wide, wider = (slip_factor(four(0.5, width=width), 0.6) for width in (0.0, 0.1, 0.2))
    assert 1.0 < narrow < wide < wider
    rear_heavy, front_heavy = (slip_factor(four(0.5, ahead), 0.6) for ahead in (-0.1, 0.1))
    assert front_heavy == pytest.approx(rear_heavy)
    assert rear_heavy < narrow
    # It stands on one axle alone.
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
