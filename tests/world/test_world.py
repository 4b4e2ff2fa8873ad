"""Specs of the world: bodies of one and of several shapes, physics, gravity and disturbances."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from sim_action import world
from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose, quaternion_from_rpy
from sim_action.robot.model.robot_spec import Robot
from sim_action.world.parts import BoxPart, CylinderPart, HullPart, SpherePart, mass_properties_of, moved

BALL: dict[str, Any] = {"name": "ball", "sphere": {"radius": "10 cm"}}


def test_the_least_world_is_flat_and_empty() -> None:
    assert world.World() == world.World(ground=world.Ground(friction=1.0), objects=())
    assert world.Physics() == world.Physics(rate=240.0, settle=2.0)


def test_bounds_of_physics_are_the_engines_or_lower() -> None:
    assert world.Physics.model_validate({"max_speed": "36 km/h", "max_turn_rate": "60 rpm"}).max_speed == pytest.approx(
        10.0
    )
    for key, bound in [("max_speed", 1.1e4), ("max_turn_rate", 1.1e4), ("max_speed", 0.0), ("max_depth", 0.0)]:
        with pytest.raises(ValidationError, match=key):
            world.Physics.model_validate({key: bound})


def test_a_placement_turns_by_its_angles_and_is_left_out_on_the_ground() -> None:
    assert (Placement().z, Placement().orientation_xyzw) == (None, (0.0, 0.0, 0.0, 1.0))
    placement = Placement.model_validate({"x": "5 cm", "yaw": "90 deg"})
    assert placement.x == 0.05
    assert placement.orientation_xyzw == pytest.approx((0, 0, math.sqrt(0.5), math.sqrt(0.5)))


@pytest.mark.parametrize("key", ["x", "y", "z"])
@pytest.mark.parametrize("value", [-100_001, "101 km", 1e300])
def test_nothing_is_where_engines_know_no_millimetres(key: str, value: object) -> None:
    for model, keys in ((Placement, {}), (world.PathPoint, {"at": 0})):
        assert model.model_validate({**keys, key: 100_000})
        with pytest.raises(ValidationError, match="100000"):
            model.model_validate({**keys, key: value})


def test_a_base_is_free_or_fixed_or_left_to_the_model() -> None:
    assert Robot(model="a").base is None
    with pytest.raises(ValidationError, match="'free' or 'fixed'"):
        Robot.model_validate({"model": "a", "base": "bolted"})


@pytest.mark.parametrize(
    "shape", [{"box": (1, 2, 3)}, {"cylinder": {"radius": 1, "height": 2}}, {"sphere": {"radius": 1}}]
)
def test_a_body_has_one_shape(shape: dict[str, Any]) -> None:
    body = world.Body.model_validate({"name": "thing", **shape})
    assert body.mass is None
    assert body.friction == 0.5


@pytest.mark.parametrize("shape", [{}, {"box": (1, 2, 3), "sphere": {"radius": 1}}])
def test_a_body_with_no_shape_or_two_is_refused(shape: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match=r"exactly one shape of 'box', 'cylinder', .* 'map' and 'shapes'"):
        world.Body.model_validate({"name": "thing", **shape})


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
        {"sphere": None, "box": (1, 2)},
        {"sphere": None, "box": (1, 2, 3, 4)},
        {"sphere": None, "box": (1, 0, 3)},
        {"sphere": None, "box": (1, -2, 3)},
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
def test_impossible_bodies_are_refused(change: dict[str, Any]) -> None:
    body = {key: value for key, value in {**BALL, **change}.items() if value is not None}
    with pytest.raises(ValidationError):
        world.Body.model_validate(body)


@pytest.mark.parametrize("rate", [0, -240, 0.5, "1 MHz", 100_001])
def test_a_physics_rate_is_one_that_can_be_stepped(rate: float | str) -> None:
    with pytest.raises(ValidationError):
        world.Physics.model_validate({"rate": rate})


def test_units_are_read_on_the_way_in() -> None:
    assert world.Physics.model_validate({"rate": "1 kHz", "settle": "500 ms"}) == world.Physics(rate=1000.0, settle=0.5)
    assert world.Body.model_validate({**BALL, "mass": "500 g"}) == world.Body(
        name="ball", sphere=world.Sphere(radius=0.1), mass=0.5
    )


@pytest.mark.parametrize(
    ("written", "xyz"),
    [(1.62, (0, 0, -1.62)), ("162 cm/s^2", (0, 0, -1.62)), (0, (0, 0, 0)), ((0, "1 m/s^2", -9), (0, 1, -9))],
)
def test_gravity_is_downwards_or_a_vector(written: object, xyz: tuple[float, ...]) -> None:
    assert world.World.model_validate({"gravity": written}).gravity_xyz == pytest.approx(xyz)
    assert (world.World().gravity_xyz, world.World().weight) == ((0, 0, -world.GRAVITY), world.GRAVITY)
    assert world.World.model_validate({"gravity": (0, 3, -4)}).weight == 5.0


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
        world.World.model_validate({"gravity": written})


def test_a_ramp_is_told_by_its_height_or_its_angle() -> None:
    by_angle, by_height = (
        world.Ramp(length=2, width=1, angle=math.atan(0.25)),
        world.Ramp(length=2, width=1, height=0.5),
    )
    (part,), (same,) = by_angle.parts(), by_height.parts()
    assert np.array(part.points_xyz) == pytest.approx(np.array(same.points_xyz))
    assert set(same.points_xyz) == {(x, y, z) for x, z in ((-1, -0.25), (1, -0.25), (1, 0.25)) for y in (-0.5, 0.5)}
    for neither_or_both in ({}, {"height": 1, "angle": 0.1}):
        with pytest.raises(ValidationError, match="either 'height' or 'angle'"):
            world.Ramp.model_validate({"length": 1, "width": 1, **neither_or_both})


def test_stairs_are_columns_that_stand_on_one_floor() -> None:
    columns = world.Stairs(steps=3, rise=0.1, run=0.3, width=1).parts()
    assert [round(column.pose.position_xyz[2] - column.size_xyz[2] / 2, 9) for column in columns] == [-0.15] * 3
    assert [column.pose.position_xyz[2] + column.size_xyz[2] / 2 for column in columns] == pytest.approx(
        [-0.05, 0.05, 0.15]
    )
    assert [column.pose.position_xyz[0] for column in columns] == pytest.approx([-0.3, 0, 0.3])


@pytest.mark.parametrize(
    ("heights", "message"),
    [
        (((0, 1), (0,)), "at least two rows with at least two samples each"),
        (((0, 1, 2), (0, 1)), "rows of different lengths: row 0 has 3 samples, row 1 has 2"),
        (((0, math.nan), (0, 1)), "finite"),
        (((0, 1e9), (0, 1)), "10000"),
        (((0, 1),), "at least two rows"),
        ((), "at least two rows"),
    ],
)
def test_a_heightfield_is_a_whole_grid_of_numbers(heights: object, message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        world.Heightfield.model_validate({"heights": heights, "size": (1, 1)})


def test_a_heightfield_is_told_by_numbers_or_an_image() -> None:
    flat = ((0.0, 0.0), (0.0, 0.0))
    for wrong in ({}, {"heights": flat, "image": "a.pgm"}, {"heights": flat, "height": 1}, {"image": "a.pgm"}):
        with pytest.raises(ValidationError, match=r"either 'heights' or 'image'|'height' is the height"):
            world.Heightfield.model_validate({"size": (1, 1), **wrong})


def test_what_cannot_move_has_no_mass() -> None:
    ramp = {"length": 1, "width": 1, "height": 1}
    with pytest.raises(ValidationError, match="'ramp' is always fixed: remove 'mass'"):
        world.Body.model_validate({"name": "it", "ramp": ramp, "mass": 1})


def test_a_body_without_z_stands_on_the_ground_however_it_is_turned() -> None:
    body = world.Body(name="it", box=(2, 1, 1), pose=Placement(x=1, pitch=math.pi / 2))
    assert world.placed(body, body.parts()).position_xyz == pytest.approx((1, 0, 1))
    (part,) = body.parts()
    assert part == BoxPart((2, 1, 1))
    high = body.model_copy(update={"pose": Placement(z=7)})
    assert world.placed(high, body.parts()) == Pose((0, 0, 7))
    assert isinstance(world.Ramp(length=1, width=1, height=1).parts()[0], HullPart)


def test_patches_have_bounds() -> None:
    assert world.Patch(x=1, y=2, size=(2, 1), friction=0.1).bounds == ((0, 2), (1.5, 2.5))
    for wrong in ({"size": (0, 1)}, {"size": (1e9, 1)}, {"friction": -1}, {"x": 1e9}):
        with pytest.raises(ValidationError):
            world.Patch.model_validate({"size": (1, 1), "friction": 0.1, **wrong})


FORCE: dict[str, Any] = {"at": "2 s", "for": "100 ms", "force": ("10 N", 0, "1 kN")}


def test_units_are_read() -> None:
    disturbance = world.Disturbance.model_validate(FORCE)
    assert disturbance.force == (10.0, 0.0, 1000.0)
    assert disturbance.end == pytest.approx(2.1)
    push = world.Disturbance.model_validate({"at": 4, "velocity": (0, "36 km/h", 0), "body": "ball"})
    assert push.velocity == (0.0, 10.0, 0.0)
    assert push.end == 4.0


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"at": 1}, "needs 'force' and 'torque'"),
        ({**FORCE, "velocity": (1, 0, 0)}, "needs 'force' and 'torque'"),
        ({"at": 1, "force": (1, 0, 0)}, "needs a duration"),
        ({"at": 1, "torque": (1, 0, 0)}, "needs a duration"),
        ({"at": 1, "for": 1, "velocity": (1, 0, 0)}, "remove 'for'"),
        ({"at": 1, "for": 1, "torque": (1, 0, 0), "point": (0, 0, 0)}, "'point' needs a 'force'"),
        ({**FORCE, "link": "a", "body": "b"}, "not both"),
        ({**FORCE, "at": -1}, "greater than or equal to 0"),
        ({**FORCE, "force": (1, 2)}, "Field required"),
        ({**FORCE, "torque": ("1 N", 0, 0)}, "not a unit of torque"),
    ],
)
def test_disturbances_that_do_not_fit_together_are_refused(keys: dict[str, Any], told: str) -> None:
    with pytest.raises(ValidationError, match=told):
        world.Disturbance.model_validate(keys)


TABLE: dict[str, Any] = {
    "name": "table",
    "shapes": (
        {"box": (1.0, 0.6, 0.04), "pose": {"z": 0.72}},
        {"cylinder": {"radius": 0.05, "height": 0.7}, "pose": {"z": 0.35}},
    ),
}


def test_the_shapes_of_a_body_are_placed_in_its_frame() -> None:
    body = world.Body.model_validate(TABLE)
    top, leg = body.parts()
    assert (body.shape, body.is_read, body.has_own_inertia) == ("shapes", False, False)
    assert isinstance(top, BoxPart)
    assert top.pose == Pose((0.0, 0.0, 0.72))
    assert isinstance(leg, CylinderPart)
    assert leg.pose == Pose((0.0, 0.0, 0.35))
    assert world.placed(body, body.parts()).position_xyz == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"shapes": ()}, "at least 1 item"),
        ({"shapes": ({},)}, "needs exactly one of box, cylinder"),
        ({"shapes": ({"box": (1, 1, 1), "sphere": {"radius": 1}},)}, "'box' and 'sphere' are in one shape; begin each"),
        ({"shapes": ({"sphere": {"radius": 1}},), "sphere": {"radius": 1}}, "found 'sphere' and 'shapes'"),
        ({"sphere": {"radius": 1}, "center_of_mass": (0, 0, 1)}, "'center_of_mass' needs a 'mass'"),
        ({"sphere": {"radius": 1}, "inertia": {"ixx": 1, "iyy": 1, "izz": 1}}, "'inertia' needs a 'mass'"),
        ({"sphere": {"radius": 1}, "mass": 1, "inertia": {"ixx": 1, "iyy": 1, "izz": 3}}, "no body has the moments"),
        ({"sphere": {"radius": 1}, "mass": 1, "inertia": {"ixx": 0, "iyy": 1, "izz": 1}}, "no body has the moments"),
        (
            {"sphere": {"radius": 1}, "mass": 1, "inertia": {"ixx": 0.02, "iyy": 0.02, "izz": 0.02, "ixy": 0.05}},
            "no body has the principal moments -0.03 0.02 0.07",
        ),
        (
            {"sphere": {"radius": 1}, "mass": 1, "inertia": {"ixx": 2, "iyy": 2, "izz": 1.2, "iyz": 1.2}},
            "no body has the principal moments 0.335",
        ),
    ],
)
def test_mass_properties_and_shapes_that_do_not_fit_are_refused(keys: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        world.Body.model_validate({"name": "b", **keys})


def test_the_mass_of_several_shapes_is_spread_by_their_volumes() -> None:
    halves = tuple({"box": (1, 1, 1), "pose": {"x": x}} for x in (-0.5, 0.5))
    whole = world.Body.model_validate({"name": "w", "shapes": ({"box": (2, 1, 1)},), "mass": 6})
    both = world.Body.model_validate({"name": "b", "shapes": halves, "mass": 6})
    one, other = (mass_properties_of(body, body.parts()) for body in (whole, both))
    assert other.centre_xyz == pytest.approx(one.centre_xyz)
    assert np.diag(one.inertia) == pytest.approx([1.0, 2.5, 2.5])
    assert other.inertia == pytest.approx(one.inertia)


def test_a_turned_cylinder_has_the_inertia_of_its_hull() -> None:
    turned = Pose((0.1, 0.2, 0.3), quaternion_from_rpy(0.3, 0.7, -0.4))
    angles = np.linspace(0, 2 * math.pi, 400, endpoint=False)
    rim = [(0.2 * math.cos(angle), 0.2 * math.sin(angle), z) for angle in angles for z in (-0.4, 0.4)]
    body = world.Body.model_validate({"name": "c", "shapes": ({"sphere": {"radius": 1}},), "mass": 2})
    exact = mass_properties_of(body, [moved(CylinderPart(0.2, 0.8), turned)])
    sampled = mass_properties_of(body, [moved(HullPart(tuple(rim)), turned)])
    assert exact.centre_xyz == pytest.approx(sampled.centre_xyz)
    assert exact.inertia == pytest.approx(sampled.inertia, rel=1e-3)


def test_stated_mass_properties_replace_those_of_uniform_density() -> None:
    inertia = {"ixx": 0.1, "iyy": 0.2, "izz": 0.25, "ixy": 0.01}
    body = world.Body.model_validate({**TABLE, "mass": 4, "center_of_mass": (0, 0, 0.1), "inertia": inertia})
    found = mass_properties_of(body, body.parts())
    assert body.has_own_inertia
    assert (found.mass, found.centre_xyz) == (4, (0, 0, 0.1))
    assert found.inertia.tolist() == [[0.1, 0.01, 0.0], [0.01, 0.2, 0.0], [0.0, 0.0, 0.25]]


def test_a_part_moves_with_its_frame() -> None:
    turned = Pose((1.0, 0.0, 0.0), quaternion_from_rpy(0, 0, math.pi / 2))
    ball = moved(SpherePart(0.1, Pose((1.0, 0.0, 0.0))), turned)
    hull = moved(HullPart(((1.0, 0.0, 0.0),)), turned)
    assert isinstance(ball, SpherePart)
    assert ball.pose.position_xyz == pytest.approx((1, 1, 0))
    assert isinstance(hull, HullPart)
    assert hull.points_xyz[0] == pytest.approx((1, 1, 0))
