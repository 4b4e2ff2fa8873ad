"""Ackermann steering: recognition, problems, limits, and what it makes of a twist."""

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
from sim_action.drives.ackermann import ON_THE_SPOT, TOO_TIGHT, AckermannDrive
from sim_action.robot.model.robot_model import RobotModel
from tests.drives.carts import CAR, FRONT, RADIUS, REAR, STEERED, asking, cart, steered, wheel

DRIVE = AckermannDrive(steering=("a_steer", "b_steer"), wheels=("c", "d"))
QUICK = DRIVE.model_copy(update={"acceleration": 1e6})
DOWN: Vector3 = (0.0, 0.0, -1.0)
TIGHT = Twist.planar(0.1, 2.0)


def problems(drive: AckermannDrive, model: RobotModel = CAR) -> list[tuple[tuple[str | int, ...], str]]:
    return list(drive.problems(model))


def limited(lower: float | None, upper: float | None) -> RobotModel:
    """The car with other limits, in rad, of one of its steering joints."""
    changed = dataclasses.replace(CAR.joints_by_name["a_steer"], lower=lower, upper=upper)
    return dataclasses.replace(CAR, joints=tuple(changed if joint.name == "a_steer" else joint for joint in CAR.joints))


def test_two_steered_wheels_and_two_that_are_not_are_recognised() -> None:
    assert recognise(CAR) == DRIVE
    assert problems(DRIVE) == []

    # One steering joint with limits is enough, as with racecar of pybullet_data.
    assert recognise(cart(*REAR, FRONT[0], steered("b", 0.5, -0.2, limit=None))) == DRIVE


@pytest.mark.parametrize(
    "model",
    [
        cart(*REAR, *(steered(name, 0.5, y, limit=None) for name, y in (("a", 0.2), ("b", -0.2)))),
        cart(*REAR, FRONT[0]),
        cart(*REAR, *(steered(name, 0.5, y, axis=(1.0, 0.0, 0.0)) for name, y in (("a", 0.2), ("b", -0.2)))),
        cart(*FRONT, steered("c", 0.0, 0.2), steered("d", 0.0, -0.2)),
    ],
    ids=["casters", "three wheels", "hinges that lie", "all steered"],
)
def test_what_is_not_plain_is_not_recognised(model: RobotModel) -> None:
    assert recognise(model) is None


def test_what_gzs_plugin_says_is_taken() -> None:
    plugin, joints = "gz-sim-ackermann-steering-system", f"left_joint=c right_joint=d {STEERED}"
    figures = "wheel_base=0.52 kingpin_width=0.4 wheel_radius=0.104 steering_limit=0.5"
    model = asking(CAR, plugin, f"{joints} {figures}")
    stated = DRIVE.model_copy(update={"wheelbase": 0.52, "radius": 0.104, "steering_limit": 0.5})
    assert recognise(model) == stated
    no_limit = "; the plugin has no limit for acceleration, so 1 m/s^2 is used"
    assert stated.describe(model) == stated.describe(CAR) + no_limit
    # What no car has is passed over.
    for wrong in ("wheel_radius=1e-300", "wheel_radius=1e300", "steering_limit=3.14", "left_steering_joint=a_steer"):
        model = asking(CAR, plugin, f"{joints} {wrong}")
        assert recognise(model) == DRIVE
        assert "ackermann" in DRIVE.describe(model)


def test_a_curve_is_angles_and_speeds_that_fit() -> None:
    speed, turn = 2.0, 1.0
    (targets,) = QUICK.open(CAR, 100.0).targets(Twist.planar(speed, turn), 1)
    middle = speed / turn
    assert targets.position == {
        "a_steer": pytest.approx(math.atan(0.5 / (middle - 0.2))),
        "b_steer": pytest.approx(math.atan(0.5 / (middle + 0.2))),
    }
    assert targets.velocity == {
        "c": pytest.approx(turn * (middle - 0.2) / RADIUS),
        "d": pytest.approx(turn * (middle + 0.2) / RADIUS),
    }


def test_driven_wheels_that_are_steered_are_as_fast_as_their_own_radius() -> None:
    drive = QUICK.model_copy(update={"wheels": ("a", "b", "c", "d")})
    (targets,) = drive.open(CAR, 100.0).targets(Twist.planar(2.0, 1.0), 1)
    assert targets.velocity["a"] == pytest.approx(math.hypot(0.5, 1.8) / RADIUS)
    assert targets.velocity["b"] == pytest.approx(math.hypot(0.5, 2.2) / RADIUS)
    assert list(targets.velocity) == ["a", "b", "c", "d"]
    # A tyre beside its kingpin stays on the wheel's axle, which leads to the middle of the curve.
    model = cart(*REAR, steered("a", 0.5, 0.2, beside=0.05), FRONT[1])
    (targets,) = drive.open(model, 100.0).targets(Twist.planar(2.0, 1.0), 1)
    assert targets.velocity["a"] == pytest.approx((math.hypot(0.5, 1.8) - 0.05) / RADIUS)


def test_axes_that_point_the_other_way_turn_the_other_way() -> None:
    model = cart(wheel("c", 0.0, 0.2, axis=(0.0, -1.0, 0.0)), REAR[1], steered("a", 0.5, 0.2, axis=DOWN), *FRONT[1:])
    (plain,), (turned,) = (QUICK.open(car, 100.0).targets(Twist.planar(2.0, 1.0), 1) for car in (CAR, model))
    assert turned.position["a_steer"] == pytest.approx(-plain.position["a_steer"])
    assert turned.velocity["c"] == pytest.approx(-plain.velocity["c"])
    assert turned.position["b_steer"] == pytest.approx(plain.position["b_steer"])


def test_one_steering_joint_in_the_middle_is_a_tricycle() -> None:
    model = cart(*REAR, steered("m", 0.5, 0.0))
    drive = QUICK.model_copy(update={"steering": ("m_steer",)})
    assert problems(drive, model) == []
    (targets,) = drive.open(model, 100.0).targets(Twist.planar(2.0, 1.0), 1)
    assert targets.position == {"m_steer": pytest.approx(math.atan(0.25))}


def test_rear_wheels_that_steer_turn_the_other_way() -> None:
    model = cart(*REAR, steered("a", -0.5, 0.2), steered("b", -0.5, -0.2))
    (targets,) = QUICK.open(model, 100.0).targets(Twist.planar(2.0, 1.0), 1)
    assert targets.position["a_steer"] == pytest.approx(-math.atan(0.5 / 1.8))


def test_told_to_turn_on_the_spot_it_stands_still_and_says_so_and_a_stop_keeps_its_angle() -> None:
    motion = DRIVE.open(CAR, 100.0)
    (targets,) = motion.targets(Twist.planar(0.0, 1.0), 5)
    assert {*targets.velocity.values(), *targets.position.values()} == {0.0}
    assert motion.notes == (ON_THE_SPOT,)
    motion = QUICK.open(CAR, 100.0)
    (curve,), (stopped,) = motion.targets(Twist.planar(2.0, 1.0), 1), motion.targets(Twist(), 1)
    assert stopped.position == curve.position
    assert motion.notes == ()


@pytest.mark.parametrize("way", [1, -1])
def test_too_tight_a_curve_is_the_tightest_there_is_and_says_so(way: int) -> None:
    motion = QUICK.open(CAR, 100.0)
    (targets,) = motion.targets(Twist.planar(0.1, way * 2.0), 1)
    inner = "a_steer" if way > 0 else "b_steer"
    assert targets.position[inner] == pytest.approx(way * 0.6)
    assert motion.notes == (TOO_TIGHT,)


@pytest.mark.parametrize("left", [0.2, -0.2])
def test_one_steered_wheel_beside_the_middle_turns_tightest_to_its_own_side(left: float) -> None:
    drive = AckermannDrive(steering=("a_steer",), wheels=("c", "d"))
    model = cart(*REAR, steered("a", 0.5, left, limit=0.6))
    assert drive.mobility(model).tightest == pytest.approx(math.tan(0.6) / (0.5 + 0.2 * math.tan(0.6)))
    # No curve fits a wheel that is turned further than towards the middle of the axle.
    beyond = drive.wheel_motion(model).way({"c": 1.0, "d": 1.0}, {"a_steer": math.copysign(1.4, -left)})
    assert beyond.turn == 0.0


def test_steering_takes_its_time_and_wheels_fit_the_curve_of_the_moment() -> None:
    drive = QUICK.model_copy(update={"steering_rate": 1.0})
    planned = drive.open(CAR, 10.0).targets(Twist.planar(2.0, 1.0), 9)
    inner = math.atan(0.5 / 1.8)
    assert [targets.position["a_steer"] for targets in planned] == pytest.approx([0.1, 0.2, inner, inner])
    first = planned[0]
    curvature = math.tan(0.1) / (0.5 + 0.2 * math.tan(0.1))
    assert first.velocity["c"] * RADIUS == pytest.approx(2.0 * (1 - 0.2 * curvature))
    # Without a rate of its own, the drive takes the one of the model.
    model = cart(*REAR, *(steered(name, 0.5, y, rate=2.0) for name, y in (("a", 0.2), ("b", -0.2))))
    (targets,) = DRIVE.open(model, 10.0).targets(Twist.planar(2.0, 1.0), 1)
    assert targets.position["a_steer"] == pytest.approx(0.2)


@given(st.lists(st.tuples(st.floats(-2, 2), st.floats(-3, 3), st.integers(1, 20)), min_size=1, max_size=5))
def test_no_step_is_beyond_a_limit(twists: list[tuple[float, float, int]]) -> None:
    drive = DRIVE.model_copy(update={"steering_rate": 2.0, "acceleration": 3.0})
    motion = drive.open(CAR, 100.0)
    angles = {"a_steer": 0.0, "b_steer": 0.0}
    speed = 0.0
    for linear, angular, steps in twists:
        for targets in motion.targets(Twist.planar(linear, angular), steps):
            for name, angle in targets.position.items():
                assert abs(angle) <= 0.6 * (1 + 1e-9)
                assert abs(angle - angles[name]) <= 0.02 * (1 + 1e-9)
            # Rear wheels that are not steered: their mean is the middle's.
            now = (targets.velocity["c"] + targets.velocity["d"]) * RADIUS / 2
            assert abs(now - speed) <= 0.03 * (1 + 1e-6)
            angles, speed = dict(targets.position), now


def test_stated_figures_win_over_the_models() -> None:
    drive = QUICK.model_copy(update={"wheelbase": 1.0, "track": 1.0, "radius": 0.2})
    assert "wheel radius 0.2 m, wheelbase 1 m, track 1 m" in drive.describe(CAR)
    (limited_targets,) = QUICK.model_copy(update={"steering_limit": 0.3}).open(CAR, 100.0).targets(TIGHT, 1)
    assert limited_targets.position["a_steer"] == pytest.approx(0.3)
    (targets,) = drive.open(CAR, 100.0).targets(Twist.planar(2.0, 1.0), 1)
    assert targets.position["a_steer"] == pytest.approx(math.atan(1.0 / 1.5))
    assert targets.velocity["c"] == pytest.approx(1.5 / 0.2)


@pytest.mark.parametrize(("torque", "max_effort"), [(None, {}), (2.0, {"c": 2.0, "d": 2.0})])
def test_a_torque_limits_every_driven_wheel(torque: float | None, max_effort: dict[str, float]) -> None:
    (targets,) = DRIVE.model_copy(update={"torque": torque}).open(CAR, 1.0).targets(Twist(), 1)
    assert targets.max_effort == max_effort


def test_a_description_has_every_figure_and_shows_an_assumed_limit() -> None:
    assert DRIVE.describe(CAR) == (
        "ackermann: steering a_steer, b_steer (up to 34.38 deg); driven c, d; wheel radius 0.1 m, wheelbase 0.5 m, "
        "track 0.4 m, acceleration 1 m/s^2"
    )
    model = cart(*REAR, *(steered(name, 0.5, y, limit=None, rate=1.0) for name, y in (("a", 0.2), ("b", -0.2))))
    assert "(up to 45 deg, assumed, 57.3 deg/s)" in DRIVE.describe(model)
    assert DRIVE.open(CAR, 1.0).joints == {"a_steer", "b_steer", "c", "d"}


@pytest.mark.parametrize(("lower", "upper"), [(None, 0.3), (-0.3, None), (-0.3, 0.4)], ids=str)
def test_a_limit_on_one_side_limits_both(lower: float | None, upper: float | None) -> None:
    model = limited(lower, upper)
    assert recognise(model) == DRIVE
    assert "(up to 17.19 deg)" in DRIVE.describe(model)


@pytest.mark.parametrize("key", ["radius", "track"])
def test_lengths_that_no_car_has_are_problems(key: str) -> None:
    assert problems(DRIVE.model_copy(update={key: 1e-9})) == [((key,), "must be at least 1e-06 m")]


def test_every_joint_that_does_not_fit_is_a_problem_at_its_place() -> None:
    drive = AckermannDrive(steering=("a", "x"), wheels=("d", "c", "y"))
    found = problems(drive)
    assert [path for path, _ in found] == [("steering", 0), ("steering", 1), ("wheels", 2)]
    assert found[0][1] == "joint 'a' does not turn about an upright axis: it cannot steer"
    ((path, message),) = problems(DRIVE.model_copy(update={"wheels": ("a_steer", "c")}))
    assert path == ("wheels", 0)
    assert message == "joint 'a_steer' steers; it cannot turn a wheel as well"


@pytest.mark.parametrize(
    ("model", "trouble"),
    [
        (cart(REAR[0], wheel("d", 0.0, -0.2, radius=None), *FRONT), "has no radius for the wheel at 'd'"),
        (cart(*REAR, steered("a", 0.0, 0.2), FRONT[1]), "directly above the fixed axle; give 'wheelbase'"),
        (cart(REAR[0], wheel("d", 0.0, -0.2, axis=DOWN), *FRONT), "'d' turns about an upright axis"),
    ],
    ids=["radius", "wheelbase", "axle"],
)
def test_what_the_model_does_not_tell_is_a_problem(model: RobotModel, trouble: str) -> None:
    ((_, message),) = problems(DRIVE, model)
    assert trouble in message


def test_without_a_fixed_axle_a_wheelbase_is_needed() -> None:
    model = cart(*FRONT, steered("c", 0.0, 0.2), steered("d", 0.0, -0.2))
    ((_, message),) = problems(DRIVE, model)
    assert message == "every wheel of the model is steered; give 'wheelbase'"
    assert problems(DRIVE.model_copy(update={"wheelbase": 0.5}), model) == []


def test_steering_that_cannot_be_straight_is_a_problem() -> None:
    ((path, message),) = problems(DRIVE, limited(0.1, 0.5))
    assert path == ("steering", 0)
    assert message == "joint 'a_steer' cannot steer: its limits must allow 0 and angles to both sides"


@pytest.mark.parametrize(
    "spec",
    [
        {"steering": []},
        {"steering": ["a", "b", "c"]},
        {"wheels": []},
        {"steering_limit": "90 deg"},
        {"steering_limit": 0},
        {"steering_rate": 0},
        {"wheelbase": 0},
        {"wheel_base": 1},
    ],
)
def test_drives_that_cannot_be_are_refused(spec: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        AckermannDrive.model_validate({"steering": ("a",), "wheels": ("b",), **spec})
