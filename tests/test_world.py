"""What is simulated, as specs."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pydantic import ValidationError

from sim_action.world import Body, Ground, Physics, Placement, Robot, Sphere, World

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
    with pytest.raises(ValidationError, match="exactly one of 'box', 'cylinder' and 'sphere'"):
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
