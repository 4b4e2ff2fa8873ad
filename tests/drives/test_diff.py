"""Differential drive: recognition, problems, and the ramps of its wheels."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from sim_action.core.geometry import Twist, Vector3
from sim_action.drives import recognise, why_not_recognised
from sim_action.drives.diff import DiffDrive
from sim_action.robot.model.robot_model import RobotModel, Shape
from sim_action.state.command import JointTargets
from tests.drives.carts import FOUR, Part, cart, wheel
from tests.traces import WHEELS, burger

LEFT, RIGHT = WHEELS
BURGER = DiffDrive(left=(LEFT,), right=(RIGHT,))
RADIUS, SEPARATION = 0.033, 0.160


def rims(targets: JointTargets) -> tuple[float, float]:
    """Rim speeds in m/s."""
    return targets.velocity[LEFT] * RADIUS, targets.velocity[RIGHT] * RADIUS


def changed(model: RobotModel, **joints: dict[str, Any]) -> RobotModel:
    """The model with fields of some joints replaced."""
    return dataclasses.replace(
        model, joints=tuple(dataclasses.replace(joint, **joints.get(joint.name, {})) for joint in model.joints)
    )


def without_radii(model: RobotModel) -> RobotModel:
    links = tuple(
        dataclasses.replace(
            link, collisions=tuple(dataclasses.replace(shape, kind="mesh", radius=None) for shape in link.collisions)
        )
        for link in model.links
    )
    return dataclasses.replace(model, links=links)


def problems(drive: DiffDrive, model: RobotModel) -> Sequence[tuple[tuple[str | int, ...], str]]:
    return list(drive.problems(model))


@pytest.mark.parametrize(
    "model",
    [
        changed(burger(), wheel_left_joint={"name": "wheel_l"}),
        changed(burger(), wheel_left_joint={"type": "revolute"}),
        cart(wheel("left_1", 0.2, 0.3), wheel("left_2", -0.2, 0.3), wheel("right", 0.0, -0.3)),
        without_radii(burger()),
        dataclasses.replace(burger(), joints=(), links=burger().links[:1]),
        changed(burger(), wheel_right_joint={"origin": burger().joints_by_name[LEFT].origin}),
    ],
    ids=["odd name", "a joint with limits", "three wheels", "wheels that are meshes", "no joints", "one place"],
)
def test_what_is_not_plain_is_not_recognised(model: RobotModel) -> None:
    assert recognise(model) is None


def test_the_burger_is_recognised_and_a_lidar_that_turns_is_no_wheel() -> None:
    lidar = changed(burger(), scan_joint={"type": "continuous", "name": "left_lidar"})
    model = without_radii(burger())
    links = tuple(
        dataclasses.replace(link, collisions=(Shape("sphere", link.collisions[0].pose, 0.05),))
        if "wheel" in link.name
        else link
        for link in model.links
    )
    assert recognise(burger()) == recognise(lidar) == recognise(dataclasses.replace(model, links=links)) == BURGER


def of_left(**fields: Any) -> RobotModel:
    return changed(burger(), wheel_left_joint=fields)


STACKED = changed(burger(), wheel_right_joint={"origin": burger().joints_by_name[LEFT].origin})
ALLOWED = "(allowed: wheel_left_joint, wheel_right_joint)"
CONTINUOUS = "a wheel needs a 'continuous' joint"
SWAPPED = "these wheels are on the right in the model; swap 'left' and 'right', or give 'heading'"


@pytest.mark.parametrize(
    ("keys", "model", "expected"),
    [
        ({}, burger(), []),
        *(({}, of_left(type="revolute", lower=a, upper=b), []) for a, b in ((None, None), (-1e9, 1e9), (2.0, -1.0))),
        ({"radius": 0.033}, without_radii(burger()), []),
        ({"separation": 0.16}, STACKED, []),
        (
            {"left": (LEFT, "wheel_left"), "right": ("scan_joint",)},
            burger(),
            [
                f"left.1: the model has no moving joint 'wheel_left'; did you mean 'wheel_left_joint'? {ALLOWED}",
                f"right.0: the model has no moving joint 'scan_joint' {ALLOWED}",
            ],
        ),
        # So do exporters write a wheel, and an engine's motor would turn it through its limits.
        (
            {},
            of_left(type="revolute", lower=0.0, upper=0.0),
            [f"left.0: joint 'wheel_left_joint' has limits, 0 deg to 0 deg: {CONTINUOUS}"],
        ),
        ({}, of_left(type="prismatic"), [f"left.0: joint 'wheel_left_joint' slides: {CONTINUOUS}"]),
        ({"right": (LEFT, RIGHT)}, burger(), ["right: a wheel cannot be on both sides"]),
        ({"left": (RIGHT,), "right": (LEFT,)}, burger(), [f"left: {SWAPPED}"]),
        ({}, STACKED, [": the left and right wheels are at the same place in the model; give 'separation'"]),
        ({}, without_radii(burger()), [f": the model has no radius for the wheel at '{LEFT}'; give 'radius'"]),
        *(({key: 1e-9}, burger(), [f"{key}: must be at least 1e-06 m"]) for key in ("radius", "separation")),
    ],
)
def test_what_does_not_fit_a_model_is_a_problem_at_its_place(
    keys: dict[str, Any], model: RobotModel, expected: list[str]
) -> None:
    found = problems(BURGER.model_copy(update=keys), model)
    assert [f"{'.'.join(map(str, path))}: {message}" for path, message in found] == expected


def test_a_description_has_every_figure_and_stated_ones_win_over_the_models() -> None:
    assert BURGER.describe(burger()) == (
        "diff drive: left wheel_left_joint; right wheel_right_joint; wheel radius 0.033 m, separation 0.16 m, "
        "acceleration 1 m/s^2, torque 10 N m"
    )
    stated = DiffDrive(left=(LEFT,), right=(RIGHT,), radius=0.5, separation=2.0)
    assert "wheel radius 0.5 m, separation 2 m" in stated.describe(burger())
    (targets,) = stated.open(burger(), 1.0).targets(Twist.planar(0.5, 0.25), 1)
    assert targets.velocity == {LEFT: pytest.approx(0.5), RIGHT: pytest.approx(1.5)}


def test_wheels_ramp_at_the_acceleration_and_then_the_plan_ends() -> None:
    for way, side in itertools.product((1, -1), (0, 1)):
        planned = BURGER.open(burger(), 10.0).targets(Twist.planar(way * 0.25), 10)
        assert [way * rims(targets)[side] for targets in planned] == pytest.approx([0.1, 0.2, 0.25, 0.25])


def test_a_plan_has_no_more_steps_than_asked_for_and_turning_left_is_the_right_wheel_forward() -> None:
    motion = BURGER.open(burger(), 10.0)
    first, second = motion.targets(Twist.planar(1.0), 2), motion.targets(Twist.planar(1.0), 2)
    assert [rims(targets)[0] for targets in (*first, *second)] == pytest.approx([0.1, 0.2, 0.3, 0.4])
    (targets,) = BURGER.open(burger(), 0.1).targets(Twist.planar(angular=1.0), 1)
    assert rims(targets) == pytest.approx((-SEPARATION / 2, SEPARATION / 2))


@pytest.mark.parametrize(
    ("wheels", "drive", "velocity"),
    [
        (
            (*FOUR[:1], wheel("b", -0.2, 0.3, radius=0.2), *FOUR[2:]),
            DiffDrive(left=("a", "b"), right=("c", "d")),
            {"a": 10, "b": 5, "c": 10, "d": 10},
        ),
        (
            (wheel("a", 0.0, 0.3), wheel("b", 0.0, -0.3, axis=(0.0, -1.0, 0.0))),
            DiffDrive(left=("a",), right=("b",)),
            {"a": 10, "b": -10},
        ),
        (
            (wheel("a", 0.0, 0.3), wheel("b", 0.0, -0.3)),
            DiffDrive(left=("b",), right=("a",), heading=math.pi),
            {"b": -10, "a": -10},
        ),
    ],
    ids=["all wheels of a side roll alike", "an axis the other way", "a stated heading"],
)
def test_how_wheels_turn(wheels: tuple[Part, ...], drive: DiffDrive, velocity: dict[str, float]) -> None:
    model = cart(*wheels)
    assert problems(drive, model) == []
    (targets,) = drive.open(model, 0.1).targets(Twist.planar(1.0), 1)
    assert list(targets.velocity) == list(velocity)
    assert targets.velocity == pytest.approx(velocity)


def test_forward_is_where_wheels_roll_with_the_left_ones_on_their_left() -> None:
    """As with r2d2 of pybullet_data, which faces its y."""
    model = cart(wheel("a", -0.3, 0.0, axis=(1.0, 0.0, 0.0)), wheel("b", 0.3, 0.0, axis=(-1.0, 0.0, 0.0)))
    drive = DiffDrive(left=("a",), right=("b",))
    assert problems(drive, model) == []
    assert "separation 0.6 m, acceleration 1 m/s^2, heading 90 deg from the base's x axis" in drive.describe(model)
    (targets,) = drive.open(model, 0.1).targets(Twist.planar(1.0), 1)
    # A wheel that turns forward about x rolls along -y.
    assert targets.velocity == {"a": pytest.approx(-10), "b": pytest.approx(10)}


def test_names_against_places_are_no_drive_but_lead_to_one() -> None:
    model = cart(wheel("left_wheel", 0.0, -0.3), wheel("right_wheel", 0.0, 0.3))
    assert recognise(model) is None
    (reason,) = [each for each in why_not_recognised(model) if each.startswith("diff: ")]
    assert reason == (
        "diff: 'left_wheel' is on the right in the model and 'right_wheel' on the left, so their names and places show "
        "different sides; state the sides in robot.drive"
    )
    placed = DiffDrive.by_place(model)
    assert placed == DiffDrive(left=("right_wheel",), right=("left_wheel",))
    assert problems(placed, model) == []
    usual = cart(wheel("left_wheel", 0.0, 0.3), wheel("right_wheel", 0.0, -0.3))
    assert (recognise(usual), DiffDrive.by_place(usual)) == (
        placed.model_copy(update={"left": placed.right, "right": placed.left}),
        None,
    )


@pytest.mark.parametrize(
    ("axis", "trouble"),
    [
        ((0.0, 0.0, 1.0), "joint 'd' turns about an upright axis in the model: it cannot be a wheel"),
        ((1.0, 0.0, 0.0), "the wheel at 'd' rolls across the others; give 'heading', the direction of forward"),
    ],
)
def test_what_does_not_roll_forward_is_no_wheel(axis: Vector3, trouble: str) -> None:
    model = cart(*FOUR[:3], wheel("d", -0.2, -0.3, axis=axis))
    assert [message for _, message in problems(DiffDrive(left=("a", "b"), right=("c", "d")), model)] == [trouble]


@pytest.mark.parametrize(
    ("twist", "noted"),
    [
        (Twist.planar(1.0, 1.0), False),
        (Twist((1.0, 0.1, 0.0)), True),
        (Twist((0.0, 0.0, 1.0)), True),
        (Twist((1.0, 0.0, 0.0), (0.0, 0.1, 1.0)), True),
    ],
)
def test_what_a_twist_asks_for_that_wheels_cannot_do_is_noted_once(twist: Twist, noted: bool) -> None:
    motion = BURGER.open(burger(), 10.0)
    motion.targets(twist, 1)
    motion.targets(Twist(), 1)
    assert len(motion.notes) == noted


@pytest.mark.parametrize(("torque", "max_effort"), [(None, {}), (2.0, {LEFT: 2.0, RIGHT: 2.0})])
def test_a_torque_limits_every_wheel(torque: float | None, max_effort: dict[str, float]) -> None:
    drive = BURGER.model_copy(update={"torque": torque})
    (targets,) = drive.open(burger(), 0.1).targets(Twist(), 1)
    assert targets.max_effort == max_effort


@given(
    st.lists(st.tuples(st.floats(-2, 2), st.floats(-5, 5), st.integers(1, 20)), min_size=1, max_size=5),
    st.floats(0.1, 5),
)
def test_no_step_changes_a_rim_by_more_than_the_acceleration(
    twists: list[tuple[float, float, int]], acceleration: float
) -> None:
    motion = BURGER.model_copy(update={"acceleration": acceleration}).open(burger(), 240.0)
    before = (0.0, 0.0)
    for linear, angular, steps in twists:
        for targets in motion.targets(Twist.planar(linear, angular), steps):
            now = rims(targets)
            change = max(abs(a - b) for a, b in zip(now, before, strict=True))
            assert change <= acceleration / 240 * (1 + 1e-9)
            before = now


@pytest.mark.parametrize("zero", [0.0, -0.0])
def test_runs_that_share_a_ramp_do_not_depend_on_each_other(zero: float) -> None:
    first, second = (BURGER.open(burger(), 240) for _ in range(2))
    there = first.targets(Twist((1.0, 0.0, 0.0), (0.0, 0.0, zero)), 10)
    there.clear()
    again = second.targets(Twist((1.0, 0.0, 0.0), (0.0, 0.0, 0.0)), 10)
    assert len(again) == 10
    assert rims(again[-1]) == pytest.approx((10 / 240, 10 / 240))
    (stopped,) = DiffDrive(left=(LEFT,), right=(RIGHT,)).open(burger(), 240).targets(Twist((zero, zero, zero)), 5)
    assert [math.copysign(1.0, speed) for speed in stopped.velocity.values()] == [1.0, 1.0]


@pytest.mark.parametrize(
    "spec",
    [
        {"left": [], "right": ["a"]},
        {"left": ["a"]},
        {"left": "a", "right": "b"},
        {"radius": 0},
        {"separation": "-1 m"},
        {"acceleration": "1 m/s"},
        {"acceleration": math.inf},
        {"torque": 0},
        {"wheels": 4},
    ],
)
def test_drives_that_cannot_be_are_refused(spec: dict[str, Any]) -> None:
    full = {"left": ("a",), "right": ("b",), **spec}
    with pytest.raises(ValidationError):
        DiffDrive.model_validate(full if "right" in spec or len(spec) == 1 else spec)
