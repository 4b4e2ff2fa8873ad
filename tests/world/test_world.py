"""What is simulated, as specs."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose
from sim_action.robot.model.robot_spec import Robot
from sim_action.world import (
    GRAVITY,
    Body,
    Ground,
    Heightfield,
    Patch,
    PathPoint,
    Physics,
    Ramp,
    Sphere,
    Stairs,
    World,
    placed,
)
from sim_action.world.parts import BoxPart, HullPart

BALL: dict[str, Any] = {"name": "ball", "sphere": {"radius": "10 cm"}}


def test_the_least_world_is_flat_and_empty() -> None:
    assert World() == World(ground=Ground(friction=1.0), objects=())
    assert Physics() == Physics(rate=240.0, settle=2.0)


def test_bounds_of_physics_are_the_engines_or_lower() -> None:
    assert Physics.model_validate({"max_speed": "36 km/h", "max_turn_rate": "60 rpm"}).max_speed == pytest.approx(10.0)
    for key, bound in [("max_speed", 1.1e4), ("max_turn_rate", 1.1e4), ("max_speed", 0.0), ("max_depth", 0.0)]:
        with pytest.raises(ValidationError, match=key):
            Physics.model_validate({key: bound})


def test_a_placement_left_out_stands_on_the_ground_unturned() -> None:
    assert Placement().z is None
    assert Placement().orientation_xyzw == (0.0, 0.0, 0.0, 1.0)


def test_a_placement_turns_by_its_angles() -> None:
    placement = Placement.model_validate({"x": "5 cm", "yaw": "90 deg"})
    assert placement.x == 0.05
    assert placement.orientation_xyzw == pytest.approx((0, 0, math.sqrt(0.5), math.sqrt(0.5)))


@pytest.mark.parametrize("key", ["x", "y", "z"])
@pytest.mark.parametrize("value", [-100_001, "101 km", 1e300])
def test_nothing_is_where_engines_know_no_millimetres(key: str, value: object) -> None:
    for model, keys in ((Placement, {}), (PathPoint, {"at": 0})):
        assert model.model_validate({**keys, key: 100_000})
        with pytest.raises(ValidationError, match="100000"):
            model.model_validate({**keys, key: value})


def test_a_base_is_free_or_fixed_or_left_to_the_model() -> None:
    assert Robot(model="a").base is None
    with pytest.raises(ValidationError, match="'free' or 'fixed'"):
        Robot.model_validate({"model": "a", "base": "bolted"})


def test_joints_of_two_robots_are_not_shared() -> None:
    assert Robot(model="a").joints is not Robot(model="b").joints


@pytest.mark.parametrize(
    "shape", [{"box": (1, 2, 3)}, {"cylinder": {"radius": 1, "height": 2}}, {"sphere": {"radius": 1}}]
)
def test_a_body_has_one_shape(shape: dict[str, Any]) -> None:
    body = Body.model_validate({"name": "thing", **shape})
    assert body.mass is None
    assert body.friction == 0.5


@pytest.mark.parametrize("shape", [{}, {"box": (1, 2, 3), "sphere": {"radius": 1}}])
def test_a_body_with_no_shape_or_two_is_refused(shape: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match=r"exactly one shape of 'box', 'cylinder', .* 'map' and 'shapes'"):
        Body.model_validate({"name": "thing", **shape})


@pytest.mark.parametrize(
    "change",
    [
        {"sphere": {"radius": 0}},
        {"sphere": {"radius": "1 kg"}},
        {"sphere": {"radius": math.nan}},
        {"mass": 0},
        {"mass": "-1 kg"},
        {"friction": -0.1},
        {"name": "a|b"},
        {"colour": "red"},
    ],
)
def test_impossible_bodies_are_refused(change: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        Body.model_validate({**BALL, **change})


@pytest.mark.parametrize("size", [(1, 2), (1, 2, 3, 4), (1, 0, 3), (1, -2, 3)])
def test_a_box_has_three_sizes_greater_than_zero(size: tuple[float, ...]) -> None:
    with pytest.raises(ValidationError):
        Body.model_validate({"name": "thing", "box": size})


@pytest.mark.parametrize("rate", [0, -240, 0.5, "1 MHz", 100_001])
def test_a_physics_rate_is_one_that_can_be_stepped(rate: float | str) -> None:
    with pytest.raises(ValidationError):
        Physics.model_validate({"rate": rate})


def test_units_are_read_on_the_way_in() -> None:
    assert Physics.model_validate({"rate": "1 kHz", "settle": "500 ms"}) == Physics(rate=1000.0, settle=0.5)
    assert Body.model_validate({**BALL, "mass": "500 g"}) == Body(name="ball", sphere=Sphere(radius=0.1), mass=0.5)


@pytest.mark.parametrize(
    ("written", "xyz"),
    [
        (1.62, (0, 0, -1.62)),
        ("162 cm/s^2", (0, 0, -1.62)),
        (0, (0, 0, 0)),
        ((0, "1 m/s^2", -9), (0, 1, -9)),
    ],
)
def test_gravity_is_downwards_or_a_vector(written: object, xyz: tuple[float, ...]) -> None:
    assert World.model_validate({"gravity": written}).gravity_xyz == pytest.approx(xyz)
    assert World().gravity_xyz == (0, 0, -GRAVITY)


def test_weight_is_that_of_the_world() -> None:
    assert World().weight == GRAVITY
    assert World.model_validate({"gravity": (0, 3, -4)}).weight == 5.0


@pytest.mark.parametrize(
    ("written", "message"),
    [
        (-9.81, r"downwards.*upwards use \[0, 0, 9.81\]"),
        ((0, 0), r"a list of three \(x, y, z\); found a list of 2"),
        (math.nan, "finite"),
        (1e9, "at most 1000"),
        ("9.81 m", "acceleration"),
        (None, "acceleration"),
        ((0, 0, 1e5), "at most 1000"),
    ],
)
def test_gravity_that_is_none_is_refused(written: object, message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        World.model_validate({"gravity": written})


def test_a_ramp_is_told_by_its_height_or_its_angle() -> None:
    by_angle, by_height = Ramp(length=2, width=1, angle=math.atan(0.25)), Ramp(length=2, width=1, height=0.5)
    (part,), (same,) = by_angle.parts(), by_height.parts()
    assert np.array(part.points_xyz) == pytest.approx(np.array(same.points_xyz))
    assert set(same.points_xyz) == {(x, y, z) for x, z in ((-1, -0.25), (1, -0.25), (1, 0.25)) for y in (-0.5, 0.5)}
    for neither_or_both in ({}, {"height": 1, "angle": 0.1}):
        with pytest.raises(ValidationError, match="either 'height' or 'angle'"):
            Ramp.model_validate({"length": 1, "width": 1, **neither_or_both})


def test_stairs_are_columns_that_stand_on_one_floor() -> None:
    columns = Stairs(steps=3, rise=0.1, run=0.3, width=1).parts()
    assert [round(column.pose.position_xyz[2] - column.size_xyz[2] / 2, 9) for column in columns] == [-0.15] * 3
    assert [column.pose.position_xyz[2] + column.size_xyz[2] / 2 for column in columns] == pytest.approx(
        [-0.05, 0.05, 0.15]
    )
    assert [column.pose.position_xyz[0] for column in columns] == pytest.approx([-0.3, 0, 0.3])


@pytest.mark.parametrize(
    "change",
    [
        {"box": (1e9, 1, 1), "sphere": None},
        {"sphere": {"radius": 1e-9}},
        {"sphere": {"radius": 1e9}},
        {"mass": 1e9},
        {"mass": 1e-9},
        {"friction": 1e9},
        {"pose": {"x": 1e9}},
        {"sphere": None, "ramp": {"length": 1, "width": 1, "angle": "89.9 deg"}},
        {"sphere": None, "stairs": {"steps": 1_000_000, "rise": 0.1, "run": 0.1, "width": 1}},
        {"sphere": None, "stairs": {"steps": 0, "rise": 0.1, "run": 0.1, "width": 1}},
    ],
)
def test_what_breaks_engines_is_refused(change: dict[str, Any]) -> None:
    body = {key: value for key, value in {**BALL, **change}.items() if value is not None}
    with pytest.raises(ValidationError):
        Body.model_validate(body)


@pytest.mark.parametrize(
    ("heights", "message"),
    [
        (((0, 1), (0,)), "at least two rows with at least two samples each"),
        (((0, 1, 2), (0, 1)), "rows of different lengths: row 0 has 3 samples, row 1 has 2"),
        (((0, math.nan), (0, 1)), "finite"),
        (((0, math.inf), (0, 1)), "finite"),
        (((0, 1e9), (0, 1)), "10000"),
        (((0, 1),), "at least two rows"),
        ((), "at least two rows"),
    ],
)
def test_a_heightfield_is_a_whole_grid_of_numbers(heights: object, message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        Heightfield.model_validate({"heights": heights, "size": (1, 1)})


def test_a_heightfield_is_told_by_numbers_or_an_image() -> None:
    flat = ((0.0, 0.0), (0.0, 0.0))
    for wrong in ({}, {"heights": flat, "image": "a.pgm"}, {"heights": flat, "height": 1}, {"image": "a.pgm"}):
        with pytest.raises(ValidationError, match=r"either 'heights' or 'image'|'height' is the height"):
            Heightfield.model_validate({"size": (1, 1), **wrong})


def test_what_cannot_move_has_no_mass() -> None:
    ramp = {"length": 1, "width": 1, "height": 1}
    with pytest.raises(ValidationError, match="'ramp' is always fixed: remove 'mass'"):
        Body.model_validate({"name": "it", "ramp": ramp, "mass": 1})


def test_a_body_without_z_stands_on_the_ground_however_it_is_turned() -> None:
    body = Body(name="it", box=(2, 1, 1), pose=Placement(x=1, pitch=math.pi / 2))
    assert placed(body, body.parts()).position_xyz == pytest.approx((1, 0, 1))
    (part,) = body.parts()
    assert part == BoxPart((2, 1, 1))
    high = body.model_copy(update={"pose": Placement(z=7)})
    assert placed(high, body.parts()) == Pose((0, 0, 7))
    assert isinstance(Ramp(length=1, width=1, height=1).parts()[0], HullPart)


def test_patches_have_bounds() -> None:
    assert Patch(x=1, y=2, size=(2, 1), friction=0.1).bounds == ((0, 2), (1.5, 2.5))
    for wrong in ({"size": (0, 1)}, {"size": (1e9, 1)}, {"friction": -1}, {"x": 1e9}):
        with pytest.raises(ValidationError):
            Patch.model_validate({"size": (1, 1), "friction": 0.1, **wrong})
