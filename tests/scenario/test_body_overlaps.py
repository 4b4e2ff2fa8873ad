"""Bodies that begin inside each other are told before anything runs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import Location
from sim_action.core.geometry import Pose, Vector3, quaternion_from_rpy, rotate
from sim_action.scenario.body_overlaps import clashes, depth, inner_solids
from sim_action.scenario.stage import Clashes
from sim_action.world import Body, World
from sim_action.world.parts import BoxPart, CylinderPart, HullPart, Part, SpherePart
from tests.scenarios import told

REMEDY = "or run with it: allow: [overlapping-bodies] [overlapping-bodies]"
WALL = {"name": "wall", "box": (1, 1, 1), "pose": {"x": 3}}


def found(*bodies: Mapping[str, object]) -> list[tuple[str, str]]:
    world = World(objects=tuple(Body.model_validate(body) for body in bodies))
    return [(".".join(map(str, path)), message) for path, message in Clashes.of(world, clashes(world), {}).problems()]


def ball(name: str = "ball", **keys: object) -> dict[str, object]:
    return {"name": name, "sphere": {"radius": 0.1}, "mass": 1, **keys}


def test_what_would_be_thrown_out_is_told_once() -> None:
    inside = f"which would throw it out; move it, {REMEDY}"
    assert found(WALL, ball(pose={"x": 2.45, "z": 0.5})) == [
        ("world.objects.1.pose", f"'ball' begins 0.05 m deep in 'wall', {inside}")
    ]
    assert found(ball("a", pose={"z": 1}), ball("b", pose={"z": 1.1})) == [
        ("world.objects.0.pose", f"'a' begins 0.1 m deep in 'b', {inside}")
    ]
    assert found(ball(pose={"z": 0.02})) == [
        ("world.objects.0.pose", f"'ball' begins 0.08 m deep in the ground, {inside}")
    ]


@pytest.mark.parametrize(
    "bodies",
    [
        (WALL, ball(pose={"x": 2.396, "z": 0.5})),
        (WALL, {**WALL, "name": "second"}),
        (WALL, ball(pose={"x": 3, "z": 0.5}, appears=1)),
        (WALL, ball(pose={"x": 3, "z": 1.1})),
        (ball(pose={"z": 0.096}),),
        ({**WALL, "mass": 5},),
        ({"name": "slope", "ramp": {"length": 1, "width": 1, "height": 1}}, ball(pose={"z": 0.2})),
        tuple(ball(f"b{number}", pose={"z": 1}) for number in range(400)),
    ],
    ids=["4 mm", "fixed", "later", "on top", "in the ground", "stands", "left to the run", "very many"],
)
def test_what_would_not_or_is_left_to_the_run_is_not(bodies: tuple[Mapping[str, object], ...]) -> None:
    assert found(*bodies) == []


def test_bodies_of_a_world_file_are_one_problem_with_the_first_three() -> None:
    names = ["a", "b", "c", "d"]
    bodies = [{**ball(name, pose={"x": 2.4 + 0.1 * step, "y": step, "z": 0.5})} for step, name in enumerate(names, 1)]
    wall = {**WALL, "box": (1, 20, 1)}
    world = World(objects=tuple(Body.model_validate(body) for body in (wall, *bodies)))
    places = {name: Location("w.world", line) for line, name in enumerate(["wall", *names], 10)}
    found = Clashes.of(world, clashes(world), places)
    assert list(found.problems()) == []
    (problem,) = found.problems_of_file()
    assert str(problem).startswith("w.world:14: 4 bodies begin more than 0.02 m deep in others, which would throw")
    assert str(problem).endswith(f"'b' begins 0.2 m deep in 'wall' and 1 more; move them, {REMEDY}")
    allowed = Clashes.of(world, clashes(world), places, ["overlapping-bodies"])
    assert list(allowed.problems_of_file()) == []
    (note,) = allowed.notes()
    assert note.startswith("4 bodies begin inside others, and the engine throws them out: 'd' begins 0.4 m deep")


def test_a_body_of_the_scenario_in_one_of_a_world_file_is_its_own_problem() -> None:
    world = World(objects=tuple(Body.model_validate(body) for body in (WALL, ball(pose={"x": 2.49, "z": 0.5}))))
    found = Clashes.of(world, clashes(world), {"ball": Location("w.world", 3)})
    rest = f"move 'wall', {REMEDY}"
    assert list(found.problems_of_file()) == []
    assert list(found.problems()) == [
        (("world", "objects", 0, "pose"), "'ball' begins 0.09 m deep in 'wall', which would throw it out; " + rest)
    ]
    allowed = Clashes.of(world, clashes(world), {"ball": Location("w.world", 3)}, ["overlapping-bodies"])
    assert list(allowed.problems()) == []
    assert list(allowed.notes()) == [
        "1 body begins inside another, and the engine throws it out: 'ball' begins 0.09 m deep in 'wall'"
    ]


def test_it_is_told_with_its_line(tmp_path: Path) -> None:
    text = (
        "name: s\nrobot: {model: turtlebot3_burger}\nexpect: [upright]\ntime_limit: 1 s\nworld:\n  objects:\n"
        "    - {name: wall, box: [1, 1, 1], pose: {x: 3}}\n"
        "    - {name: ball, sphere: {radius: 10 cm}, mass: 1 kg, pose: {x: 3, z: 0.5}}\n"
    )
    (problem,) = told(tmp_path, text)
    assert problem.startswith("8:57: world.objects.1.pose: 'ball' begins 0.6 m deep in 'wall'")


UNIT = BoxPart((1.0, 1.0, 1.0))
BALL = SpherePart(0.5)
CAN = CylinderPart(0.5, 1.0)


def deep(one: Part, other: Part, at: Vector3, rpy: Vector3 = (0.0, 0.0, 0.0)) -> float:
    """The first stands at the origin."""
    turned = Pose(at, quaternion_from_rpy(*rpy))
    return depth(list(inner_solids([one], Pose())), list(inner_solids([other], turned)))


@pytest.mark.parametrize(
    ("one", "other", "at", "expected"),
    [
        (UNIT, UNIT, (0.9, 0.3, 0.0), 0.1),
        (UNIT, UNIT, (1.1, 0.0, 0.0), 0.0),
        (UNIT, UNIT, (0.0, 0.0, 0.0), 1.0),
        (BALL, BALL, (0.6, 0.0, 0.0), 0.4),
        (BALL, BALL, (0.6, 0.9, 0.0), 0.0),
        (UNIT, BALL, (0.9, 0.0, 0.0), 0.1),
        (UNIT, BALL, (0.5 + 0.3, 0.5 + 0.3, 0.0), 0.5 - math.hypot(0.3, 0.3)),
        (UNIT, BALL, (0.1, 0.0, 0.0), 0.9),
        (CAN, CAN, (0.9, 0.0, 0.0), 0.1),
        (CAN, BALL, (0.0, 0.0, 0.9), 0.1),
        # Of a shape that is none of these, nothing is computed.
        (HullPart(((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))), UNIT, (0.0, 0.0, 0.0), 0.0),
    ],
)
def test_depths_are_those_of_a_sketch(one: Part, other: Part, at: Vector3, expected: float) -> None:
    assert deep(one, other, at) == pytest.approx(expected, abs=1e-12)
    assert deep(other, one, (-at[0], -at[1], -at[2])) == pytest.approx(expected, abs=1e-12)


def test_a_box_that_is_turned_reaches_further() -> None:
    assert deep(UNIT, UNIT, (1.1, 0.0, 0.0), (0.0, 0.0, math.radians(45))) == pytest.approx(0.5 + math.sqrt(0.5) - 1.1)
    # An edge along z, before another along y: no face of either tells them apart.
    upright = Pose((0.0, 0.0, 0.0), quaternion_from_rpy(0.0, 0.0, math.radians(45)))
    for away, expected in ((1.40, math.sqrt(2) - 1.40), (1.42, 0.0)):
        lying = Pose((away, 0.0, 0.0), quaternion_from_rpy(0.0, math.radians(45), 0.0))
        found = depth(list(inner_solids([UNIT], upright)), list(inner_solids([UNIT], lying)))
        assert found == pytest.approx(expected, abs=1e-12)


LENGTH = st.floats(-1.5, 1.5)
TURN = st.floats(-3.0, 3.0)


@given(st.tuples(LENGTH, LENGTH, LENGTH), st.tuples(TURN, TURN, TURN))
def test_a_box_is_as_deep_as_it_takes_to_move_it_out(at: Vector3, rpy: Vector3) -> None:
    """Along some axis, moved by its depth, it is out: there is no way out that is shorter."""
    found = deep(UNIT, UNIT, at, rpy)
    own = quaternion_from_rpy(*rpy)
    axes = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    ways = [*axes, *(rotate(own, axis) for axis in axes)]
    moves = [(way * x, way * y, way * z) for x, y, z in ways for way in (-0.99 * found, 0.99 * found)]
    moved = [deep(UNIT, UNIT, (at[0] + x, at[1] + y, at[2] + z), rpy) for x, y, z in moves]
    assert found == 0 or min(moved) > 0
