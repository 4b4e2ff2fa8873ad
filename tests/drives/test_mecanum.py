"""Mecanum wheels: problems, ramps, and what they make of a twist."""

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
from sim_action.drives.mecanum import NOT_LEVEL, MecanumDrive
from sim_action.robot.model.robot_model import Mjcf, RobotModel
from sim_action.state.command import JointTargets
from tests.drives.carts import FOUR, RADIUS, asking, cart, wheel
from tests.traces import scene

DRIVE = MecanumDrive(left=("a", "b"), right=("c", "d"))
QUICK = DRIVE.model_copy(update={"acceleration": 1e6})
CART = cart(*FOUR)
AHEAD, LEFT = 0.2, 0.3


def targets(twist: Twist, drive: MecanumDrive = QUICK, model: RobotModel = CART) -> JointTargets:
    (planned,) = drive.open(model, 100.0).targets(twist, 1)
    return planned


def rims(twist: Twist) -> list[float]:
    return [speed * RADIUS for speed in targets(twist).velocity.values()]


@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(-3, 3))
def test_no_wheel_slides_across_its_rollers(ahead: float, left: float, turn: float) -> None:
    """What touches the ground moves along the roller's axle as fast as the wheel's rim takes it there."""
    found = rims(Twist.planar(ahead, turn, lateral=left))
    corners = [(AHEAD, LEFT), (-AHEAD, LEFT), (AHEAD, -LEFT), (-AHEAD, -LEFT)]
    for (x, y), rim in zip(corners, found, strict=True):
        hub = (ahead - turn * y, left + turn * x)
        axle = (1.0, -math.copysign(1.0, x * y))
        assert (hub[0] - rim) * axle[0] + hub[1] * axle[1] == pytest.approx(0.0, abs=1e-9)


def test_the_base_is_pushed_where_wheels_touch_the_ground_below_its_mass() -> None:
    push = targets(Twist.planar(1.0, 0.5, lateral=0.25), model=cart(*FOUR, mass_ahead=0.05)).base
    assert push is not None
    assert (push.linear_xy, push.angular_z) == ((1.0, 0.25), 0.5)
    assert push.point_xyz == pytest.approx((0.05, 0.0, -RADIUS))
    assert push.max_force == pytest.approx(10.0 * 9.80665 / math.sqrt(2))
    assert push.max_torque == pytest.approx(push.max_force * math.hypot(AHEAD, LEFT))


def test_rollers_hold_what_the_robot_weighs_where_it_is() -> None:
    told = DRIVE.open(CART, 240.0, 1.62).targets(Twist.planar(1.0), 1)[0].base
    assert told is not None
    assert told.max_force == pytest.approx(CART.mass * 1.62 / math.sqrt(2))
    assert f"pushed by up to {CART.mass * 1.62 / math.sqrt(2):.4g} N (0.7 of its weight)" in DRIVE.describe(CART, 1.62)


def test_a_robot_that_faces_its_y_is_pushed_along_it() -> None:
    axis: Vector3 = (1.0, 0.0, 0.0)
    places = {"a": (-0.3, 0.2), "b": (-0.3, -0.2), "c": (0.3, 0.2), "d": (0.3, -0.2)}
    model = cart(*(wheel(name, *place, axis=axis) for name, place in places.items()))
    assert list(DRIVE.problems(model)) == []
    push = targets(Twist.planar(1.0, lateral=0.5), model=model).base
    assert push is not None
    assert push.linear_xy == pytest.approx((-0.5, 1.0))


@given(
    st.lists(
        st.tuples(st.floats(-2, 2), st.floats(-2, 2), st.floats(-3, 3), st.integers(1, 20)), min_size=1, max_size=4
    )
)
def test_no_step_changes_the_velocity_of_a_wheels_hub_by_more_than_the_acceleration(
    twists: list[tuple[float, float, float, int]],
) -> None:
    motion, before = DRIVE.open(CART, 100.0), (0.0, 0.0, 0.0)
    for ahead, left, turn, steps in twists:
        for planned in motion.targets(Twist.planar(ahead, turn, lateral=left), steps):
            assert planned.base is not None
            now = (*planned.base.linear_xy, planned.base.angular_z)
            for x, y in ((AHEAD, LEFT), (-AHEAD, -LEFT)):
                change = [a - b for a, b in zip(now, before, strict=True)]
                hub = math.hypot(change[0] - y * change[2], change[1] + x * change[2])
                assert hub <= 0.01 * (1 + 1e-9)
            before = now


def test_what_is_not_level_is_noted() -> None:
    motions = [DRIVE.open(CART, 10.0) for _ in range(2)]
    motions[0].targets(Twist.planar(1.0, 1.0, lateral=1.0), 1)
    motions[1].targets(Twist((0.0, 0.0, 1.0)), 1)
    assert [motion.notes for motion in motions] == [(), (NOT_LEVEL,)]


def test_only_wheels_lose_their_friction() -> None:
    links = DRIVE.prepared(dataclasses.replace(scene(), model=CART)).model.links_by_name
    assert [links[name].surface.friction for name in ("base", "a_link", "d_link")] == [0.5, 0.0, 0.0]


def test_gzs_plugin_tells_mecanum_wheels_from_skid_steer() -> None:
    joints = "front_left_joint=a back_left_joint=b front_right_joint=c back_right_joint=d"
    model = asking(CART, "gz-sim-mecanum-drive-system", f"{joints} wheel_radius=0.104")
    stated = DRIVE.model_copy(update={"radius": 0.104})
    assert recognise(model) == stated
    no_limit = "; the plugin has no limit for acceleration, so 1 m/s^2 is used"
    assert stated.describe(model) == stated.describe(CART) + no_limit


def test_a_description_has_every_figure_and_says_that_it_is_kinematic() -> None:
    assert DRIVE.describe(CART) == (
        "mecanum drive, kinematic: left a, b; right c, d; wheel radius 0.1 m, wheelbase 0.4 m, separation 0.6 m, "
        "acceleration 1 m/s^2, wheels without friction, pushed by up to 69.34 N (0.7 of its weight)"
    )
    assert "pushed by up to 5 N" in DRIVE.model_copy(update={"force": 5.0}).describe(CART)


@pytest.mark.parametrize(
    ("drive", "model", "trouble"),
    [
        (MecanumDrive(left=("b", "a"), right=("c", "d")), CART, "the wheels are not at the corners"),
        (DRIVE, cart(*FOUR[:3], wheel("d", -0.2, -0.3, radius=None)), "has no radius for the wheel at 'd'"),
        (DRIVE, cart(*FOUR[:3], wheel("d", -0.2, -0.3, axis=(0, 0, 1))), "'d' turns about an upright axis"),
        (MecanumDrive(left=("a", "b"), right=("c", "x")), CART, "the model has no moving joint 'x'"),
    ],
)
def test_what_does_not_fit_the_model_is_a_problem(drive: MecanumDrive, model: RobotModel, trouble: str) -> None:
    ((_, message),) = drive.problems(model)
    assert trouble in message


@pytest.mark.parametrize("spec", [{"left": ["a"]}, {"left": ["a", "b", "e"]}, {"force": 0}, {"torque": 1}])
def test_drives_that_cannot_be_are_refused(spec: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        MecanumDrive.model_validate({"left": ("a", "b"), "right": ("c", "d"), **spec})


def test_a_radius_that_no_wheel_has_and_a_friction_that_the_engine_reads_itself_are_problems() -> None:
    found = list(DRIVE.model_copy(update={"radius": 1e-9}).problems(CART))
    assert found == [(("radius",), "must be at least 1e-06 m")]
    assert not isinstance(recognise(CART), MecanumDrive)
    native = dataclasses.replace(CART, mjcf=Mjcf("<mujoco/>", {}, {}))
    assert "need zero friction, but MJCF wheels keep that of their geoms" in next(iter(DRIVE.problems(native)))[1]
