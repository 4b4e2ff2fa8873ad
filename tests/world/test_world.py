"""Specs of the world: bodies of one and of several shapes, their paths, physics, gravity and disturbances."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError

from sim_action import world
from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose, compose, quaternion_from_rpy, twist_between
from sim_action.robot.model.robot_spec import Robot
from sim_action.world.body import Numbers, PathPoint, PosePath
from sim_action.world.parts import BoxPart, CylinderPart, HullPart, SpherePart, mass_properties_of, moved

GATE: dict[str, Any] = {"name": "gate", "box": (0.1, 1, 1), "pose": {"x": 1, "y": 2}}
BALL: dict[str, Any] = {"name": "ball", "sphere": {"radius": "10 cm"}}


def test_the_least_world_is_flat_and_empty() -> None:
    assert world.World() == world.World(ground=world.Ground(friction=1.0), objects=())
    assert world.Physics() == world.Physics(rate=240.0, settle=2.0)
    assert Robot(model="a").base is None


FORCE: dict[str, Any] = {"at": "2 s", "for": "100 ms", "force": ("10 N", 0, "1 kN")}
FLAT = ((0.0, 0.0), (0.0, 0.0))
RAMP: dict[str, Any] = {"length": 1, "width": 1}
SHAPES = r"exactly one shape of 'box', 'cylinder', .* 'map' and 'shapes'"
STATED = r"either 'heights' or 'image'|'height' is the height"
ROUND: dict[str, Any] = {"sphere": {"radius": 1}}
HEAVY: dict[str, Any] = {**ROUND, "mass": 1}
MOMENTS = "no body has the moments"
WAY = ({"at": 0}, {"at": 1, "x": 2})


def refused(
    model: type[BaseModel], base: dict[str, Any], *rows: tuple[dict[str, Any], str]
) -> list[tuple[type[BaseModel], dict[str, Any], str]]:
    """Return rows of `REFUSED`; `rows`: keys that do not fit to those in `base`, and the message."""
    return [(model, {**base, **keys}, message) for keys, message in rows]


REFUSED = [
    *refused(
        *(world.Body, GATE),
        ({"path": ({"at": 0},)}, "two points"),
        ({"loop": True}, "'loop' needs a 'path'"),
        ({"pace": ({"at": 1, "speed": 0},)}, "'pace' needs a 'path'"),
        ({"path": WAY, "pace": ({"at": 1, "speed": 0}, {"at": 1, "speed": 1})}, "in the order of time"),
        ({"path": WAY, "mass": 1}, "remove 'mass'"),
        ({"path": WAY, "appears": 1}, "exists from the start"),
        ({"path": WAY, "loop": True}, "must end where it starts"),
        ({"path": ({"at": 0}, {"at": 1, "yaw": "180 deg"}), "loop": True}, "must end where it starts"),
        ({"path": ({"at": -1}, {"at": 1, "x": 2})}, "greater than or equal to 0"),
        ({"path": ({"x": 1}, {"at": 1, "x": 2})}, "Field required"),
        ({"appears": 0}, "greater than 0"),
        ({"path": ({"at": 0}, {"at": 1e5, "y": 1e6})}, "less than or equal to 100000"),
    ),
    *refused(
        *(world.Body, {"name": "b"}),
        ({}, SHAPES),
        ({"box": (1, 2, 3), **ROUND}, SHAPES),
        ({"ramp": {**RAMP, "height": 1}, "mass": 1}, "'ramp' is always fixed: remove 'mass'"),
        ({"shapes": ()}, "at least 1 item"),
        ({"shapes": ({},)}, "needs exactly one of box, cylinder"),
        ({"shapes": ({"box": (1, 1, 1), **ROUND},)}, "'box' and 'sphere' are in one shape; begin each"),
        ({"shapes": (ROUND,), **ROUND}, "found 'sphere' and 'shapes'"),
        ({**ROUND, "center_of_mass": (0, 0, 1)}, "'center_of_mass' needs a 'mass'"),
        ({**ROUND, "inertia": {"ixx": 1, "iyy": 1, "izz": 1}}, "'inertia' needs a 'mass'"),
        ({**HEAVY, "inertia": {"ixx": 1, "iyy": 1, "izz": 3}}, MOMENTS),
        ({**HEAVY, "inertia": {"ixx": 0, "iyy": 1, "izz": 1}}, MOMENTS),
        ({**HEAVY, "inertia": {"ixx": 0.02, "iyy": 0.02, "izz": 0.02, "ixy": 0.05}}, "moments -0.03 0.02 0.07"),
        ({**HEAVY, "inertia": {"ixx": 2, "iyy": 2, "izz": 1.2, "iyz": 1.2}}, "no body has the principal moments 0.335"),
    ),
    *refused(
        *(world.World, {}),
        ({"gravity": -9.81}, r"downwards.*upwards use \[0, 0, 9.81\]"),
        ({"gravity": (0, 0)}, r"a list of three \(x, y, z\); found a list of 2"),
        ({"gravity": math.nan}, "finite"),
        ({"gravity": "9.81 m"}, "acceleration"),
        ({"gravity": None}, "acceleration"),
        *(({"gravity": gravity}, "at most 1000") for gravity in (1e9, (0, 0, 1e5))),
    ),
    *refused(
        *(world.Heightfield, {"size": (1, 1)}),
        ({"heights": ((0, 1), (0,))}, "at least two rows with at least two samples each"),
        ({"heights": ((0, 1, 2), (0, 1))}, "rows of different lengths: row 0 has 3 samples, row 1 has 2"),
        ({"heights": ((0, math.nan), (0, 1))}, "finite"),
        ({"heights": ((0, 1e9), (0, 1))}, "10000"),
        *(({"heights": heights}, "at least two rows") for heights in ((), ((0, 1),))),
        *((keys, STATED) for keys in ({}, {"heights": FLAT, "image": "a"}, {"heights": FLAT, "height": 1})),
        ({"image": "a"}, STATED),
    ),
    *refused(world.Ramp, RAMP, *((keys, "either 'height' or 'angle'") for keys in ({}, {"height": 1, "angle": 0.1}))),
    *refused(
        *(world.Patch, {"size": (1, 1), "friction": 0.1}),
        *(({key: value}, key) for key, value in (("size", (0, 1)), ("size", (1e9, 1)), ("friction", -1), ("x", 1e9))),
    ),
    *refused(
        *(world.Physics, {}),
        *(({key: bound}, key) for bound in (1.1e4, 0.0) for key in ("max_speed", "max_turn_rate")),
        ({"max_depth": 0.0}, "max_depth"),
        *(({"rate": rate}, "rate") for rate in (0, -240, 0.5, "1 MHz", 100_001)),
    ),
    *refused(
        *(world.Disturbance, {}),
        ({"at": 1}, "needs 'force' and 'torque'"),
        ({**FORCE, "velocity": (1, 0, 0)}, "needs 'force' and 'torque'"),
        *(({"at": 1, key: (1, 0, 0)}, "needs a duration") for key in ("force", "torque")),
        ({"at": 1, "for": 1, "velocity": (1, 0, 0)}, "remove 'for'"),
        ({"at": 1, "for": 1, "torque": (1, 0, 0), "point": (0, 0, 0)}, "'point' needs a 'force'"),
        ({**FORCE, "link": "a", "body": "b"}, "not both"),
        ({**FORCE, "at": -1}, "greater than or equal to 0"),
        ({**FORCE, "force": (1, 2)}, "Field required"),
        ({**FORCE, "torque": ("1 N", 0, 0)}, "not a unit of torque"),
    ),
    *refused(Robot, {"model": "a"}, ({"base": "bolted"}, "'free' or 'fixed'")),
]


@pytest.mark.parametrize(("model", "keys", "message"), REFUSED)
def test_keys_that_do_not_fit_are_refused(model: type[BaseModel], keys: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        model.model_validate(keys)


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


@pytest.mark.parametrize(
    "shape", [{"box": (1, 2, 3)}, {"cylinder": {"radius": 1, "height": 2}}, {"sphere": {"radius": 1}}]
)
def test_a_body_has_one_shape(shape: dict[str, Any]) -> None:
    body = world.Body.model_validate({"name": "thing", **shape})
    assert body.mass is None
    assert body.friction == 0.5


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


def test_units_are_read() -> None:
    assert world.Physics.model_validate({"rate": "1 kHz", "settle": "500 ms"}) == world.Physics(rate=1000.0, settle=0.5)
    assert world.Body.model_validate({**BALL, "mass": "500 g"}) == world.Body(
        name="ball", sphere=world.Sphere(radius=0.1), mass=0.5
    )
    disturbance = world.Disturbance.model_validate(FORCE)
    assert disturbance.force == (10.0, 0.0, 1000.0)
    assert disturbance.end == pytest.approx(2.1)
    push = world.Disturbance.model_validate({"at": 4, "velocity": (0, "36 km/h", 0), "body": "ball"})
    assert (push.velocity, push.end) == ((0.0, 10.0, 0.0), 4.0)
    fast = world.Physics.model_validate({"max_speed": "36 km/h", "max_turn_rate": "60 rpm"})
    assert fast.max_speed == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("written", "xyz"),
    [(1.62, (0, 0, -1.62)), ("162 cm/s^2", (0, 0, -1.62)), (0, (0, 0, 0)), ((0, "1 m/s^2", -9), (0, 1, -9))],
)
def test_gravity_is_downwards_or_a_vector(written: object, xyz: tuple[float, ...]) -> None:
    assert world.World.model_validate({"gravity": written}).gravity_xyz == pytest.approx(xyz)
    assert (world.World().gravity_xyz, world.World().weight) == ((0, 0, -world.GRAVITY), world.GRAVITY)
    assert world.World.model_validate({"gravity": (0, 3, -4)}).weight == 5.0


def test_a_ramp_is_told_by_its_height_or_its_angle() -> None:
    by_angle, by_height = (
        world.Ramp(length=2, width=1, angle=math.atan(0.25)),
        world.Ramp(length=2, width=1, height=0.5),
    )
    (part,), (same,) = by_angle.parts(), by_height.parts()
    assert np.array(part.points_xyz) == pytest.approx(np.array(same.points_xyz))
    assert set(same.points_xyz) == {(x, y, z) for x, z in ((-1, -0.25), (1, -0.25), (1, 0.25)) for y in (-0.5, 0.5)}


def test_stairs_are_columns_that_stand_on_one_floor() -> None:
    columns = world.Stairs(steps=3, rise=0.1, run=0.3, width=1).parts()
    assert [round(column.pose.position_xyz[2] - column.size_xyz[2] / 2, 9) for column in columns] == [-0.15] * 3
    assert [column.pose.position_xyz[2] + column.size_xyz[2] / 2 for column in columns] == pytest.approx(
        [-0.05, 0.05, 0.15]
    )
    assert [column.pose.position_xyz[0] for column in columns] == pytest.approx([-0.3, 0, 0.3])


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


TABLE: dict[str, Any] = {
    "name": "table",
    "shapes": (
        {"box": (1.0, 0.6, 0.04), "pose": {"z": 0.72}},
        {"cylinder": {"radius": 0.05, "height": 0.7}, "pose": {"z": 0.35}},
    ),
}


def test_the_shapes_of_a_body_are_placed_in_its_frame() -> None:
    body = world.Body.model_validate(TABLE)
    assert (body.shape, body.is_read, body.has_own_inertia) == ("shapes", False, False)
    parts = [(type(part), getattr(part, "pose", None)) for part in body.parts()]
    assert parts == [(BoxPart, Pose((0.0, 0.0, 0.72))), (CylinderPart, Pose((0.0, 0.0, 0.35)))]
    assert world.placed(body, body.parts()).position_xyz == (0.0, 0.0, 0.0)


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


def gate(**keys: Any) -> world.Body:
    return world.Body.model_validate({**GATE, **keys})


def test_a_body_begins_at_its_pose_or_at_the_first_point_of_its_path() -> None:
    assert gate().beginning == Placement(x=1.0, y=2.0)
    moving = gate(path=({"at": "1 s", "y": 3}, {"at": "2 s", "x": 5, "z": 1}))
    assert moving.beginning == Placement(x=1.0, y=3.0)


@pytest.mark.parametrize("end", [{"x": 1, "yaw": "360 deg"}, {"x": 1, "yaw": "-720 deg"}, {"x": 1}])
def test_a_loop_may_end_after_whole_turns(end: dict[str, Any]) -> None:
    assert gate(path=({"at": 0}, {"at": 1, "x": 2}, {"at": 2, **end}), loop=True).loop


numbers = st.tuples(*[st.floats(-10, 10)] * 6)
points = st.lists(numbers, min_size=2, max_size=6)
gaps = st.lists(st.floats(0.1, 10), min_size=6, max_size=6)


def through(points: list[Numbers], gaps: list[float], *, loops: bool = False) -> PosePath:
    times = [sum(gaps[: index + 1]) for index in range(len(points))]
    return PosePath(tuple(times), tuple(points), loops)


@given(points, gaps, st.floats(0, 1), st.floats(0, 100))
def test_it_is_at_every_point_in_its_time_and_between_two_at_the_same_share_of_the_way(
    points: list[Numbers], gaps: list[float], share: float, away: float
) -> None:
    path = through(points, gaps)
    for time, point in zip(path.times, points, strict=True):
        assert path.numbers(time) == pytest.approx(point)
    assert path.numbers(path.times[0] - away) == points[0]
    assert path.numbers(path.times[-1] + away) == points[-1]
    for (start, one), (end, other) in pairwise(zip(path.times, points, strict=True)):
        expected = [a + (b - a) * share for a, b in zip(one, other, strict=True)]
        assert path.numbers(start + (end - start) * share) == pytest.approx(expected, abs=1e-9)


@given(points, gaps, st.floats(0, 1), st.integers(0, 5))
def test_a_loop_comes_round_again(points: list[Numbers], gaps: list[float], share: float, rounds: int) -> None:
    path = through([*points[:5], points[0]], gaps, loops=True)
    period = path.times[-1] - path.times[0]
    time = path.times[0] + share * period
    # Once round is where it began, whatever the rounding of either time.
    assert path.numbers(time + rounds * period) == pytest.approx(path.numbers(time), abs=1e-9 * rounds * 1e3 + 1e-9)


def test_a_loop_waits_but_once() -> None:
    path = through([(0,) * 6, (1, 0, 0, 0, 0, 0), (0,) * 6], [5.0, 1.0, 1.0], loops=True)
    assert [path.numbers(time)[0] for time in (0, 4, 5, 5.5, 6, 7, 7.5, 8)] == [0, 0, 0, 0.5, 1, 0, 0.5, 1]


def test_what_a_point_leaves_out_stays_as_it_was_and_angles_go_as_far_as_is_written() -> None:
    said = [{"at": "1 s", "x": "2 m"}, {"at": "2 s", "yaw": "90 deg"}, {"at": "3 s", "x": 0}]
    start = Placement(x=9.0, y=3.0, z=0.5, roll=0.1)
    quarter = math.pi / 2
    assert PosePath.of(start, [PathPoint.model_validate(point) for point in said]).points == (
        (2.0, 3.0, 0.5, 0.1, 0.0, 0.0),
        (2.0, 3.0, 0.5, 0.1, 0.0, quarter),
        (0.0, 3.0, 0.5, 0.1, 0.0, quarter),
    )
    turns = [{"at": 0}, {"at": "8 s", "yaw": "720 deg"}]
    path = PosePath.of(Placement(z=0.0), [PathPoint.model_validate(point) for point in turns])
    assert [path.pose(time).yaw for time in (1.0, 3.0)] == pytest.approx([quarter, -quarter])
    assert path.numbers(4.0)[5] == pytest.approx(math.tau)


@given(points, gaps, st.floats(0, 3), st.floats(0, 1))
def test_no_point_is_faster_than_the_bound(
    numbers: list[Numbers], gaps: list[float], reach: float, share: float
) -> None:
    times = tuple(sum(gaps[:number]) for number in range(len(numbers)))
    path = PosePath(times, tuple(numbers))
    speed, turn = path.fastest(reach)
    moment, later = share * times[-1], share * times[-1] + 1e-3
    corner = (reach, 0.0, 0.0)
    one, other = (compose(path.pose(time), Pose(corner)) for time in (moment, later))
    assert math.dist(one.position_xyz, other.position_xyz) <= speed * 1e-3 * (1 + 1e-6) + 1e-9
    assert math.hypot(*twist_between(one, other, 1e-3).angular_xyz) <= turn * (1 + 1e-6) + 1e-4
    assert PosePath((0.0, 1.0), ((1.0, 2.0, 3.0, 0.0, 0.0, 0.0),) * 2).fastest(1.0) == (0.0, 0.0)
