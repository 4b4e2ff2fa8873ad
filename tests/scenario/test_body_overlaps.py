"""Bodies that begin inside each other are told before anything runs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from sim_action.core.errors import Location
from sim_action.scenario.body_overlaps import clashes
from sim_action.scenario.world_checks import Clashes
from sim_action.world import Body, World
from tests.scenarios import told

WALL = {"name": "wall", "box": (1, 1, 1), "pose": {"x": 3}}


def found(*bodies: Mapping[str, object]) -> list[tuple[str, str]]:
    world = World(objects=tuple(Body.model_validate(body) for body in bodies))
    return [(".".join(map(str, path)), message) for path, message in Clashes.of(world, clashes(world), {}).problems()]


def ball(name: str = "ball", **keys: object) -> dict[str, object]:
    return {"name": name, "sphere": {"radius": 0.1}, "mass": 1, **keys}


def test_what_would_be_thrown_out_is_told_once() -> None:
    inside = "which would throw it out; move it"
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
    ],
    ids=["4 mm", "fixed", "later", "on top", "in the ground", "stands", "left to the run"],
)
def test_what_would_not_or_is_left_to_the_run_is_not(bodies: tuple[Mapping[str, object], ...]) -> None:
    assert found(*bodies) == []


def test_a_heap_of_very_many_is_left_to_the_engine() -> None:
    heap = [ball(f"b{number}", pose={"z": 1}) for number in range(400)]
    assert found(*heap) == []


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
    assert str(problem).endswith("'b' begins 0.2 m deep in 'wall' and 1 more")


def test_a_body_of_the_scenario_in_one_of_a_world_file_is_its_own_problem() -> None:
    world = World(objects=tuple(Body.model_validate(body) for body in (WALL, ball(pose={"x": 2.49, "z": 0.5}))))

    found = Clashes.of(world, clashes(world), {"ball": Location("w.world", 3)})

    assert list(found.problems_of_file()) == []
    assert list(found.problems()) == [
        (("world", "objects", 0, "pose"), "'ball' begins 0.09 m deep in 'wall', which would throw it out; move 'wall'")
    ]


def test_it_is_told_with_its_line(tmp_path: Path) -> None:
    text = (
        "name: s\nrobot: {model: turtlebot3_burger}\nexpect: [upright]\ntime_limit: 1 s\nworld:\n  objects:\n"
        "    - {name: wall, box: [1, 1, 1], pose: {x: 3}}\n"
        "    - {name: ball, sphere: {radius: 10 cm}, mass: 1 kg, pose: {x: 3, z: 0.5}}\n"
    )
    (problem,) = told(tmp_path, text)
    assert problem.startswith("8:57: world.objects.1.pose: 'ball' begins 0.6 m deep in 'wall'")
