"""Lines around bodies at a distance."""

from __future__ import annotations

import math

import pytest

from sim_action.core.field_types import Placement
from sim_action.core.geometry import Vector3
from sim_action.core.records import replace
from sim_action.world import World
from sim_action.world.body import Body
from sim_action.world.distance_lines import distance_lines
from sim_action.world.shapes import Cylinder, Sphere
from tests.traces import scene


def lines(*bodies: Body, names: tuple[str, ...] | None = None) -> list[tuple[Vector3, ...]]:
    return list(distance_lines(replace(scene(), world=World(objects=bodies)), names, 0.5))


def cube(name: str, mass: float | None = None) -> Body:
    return Body(name=name, box=(1.0, 1.0, 1.0), mass=mass)


def test_a_box_has_a_line_with_round_corners() -> None:
    [line] = lines(Body(name="a", box=(2.0, 1.0, 1.0), pose=Placement(z=2.0)))
    away = [math.hypot(max(0.0, abs(x) - 1.0), max(0.0, abs(y) - 0.5)) for x, y, _ in line]
    assert away == pytest.approx([0.5] * len(line))
    assert line[0] == line[-1]
    assert {z for _, _, z in line} == {1.5}


def test_a_ball_and_an_upright_cylinder_have_circles() -> None:
    bodies = Body(name="a", sphere=Sphere(radius=0.3)), Body(name="b", cylinder=Cylinder(radius=0.3, height=1.0))
    away = [math.hypot(x, y) for line in lines(*bodies) for x, y, _ in line]
    assert away == pytest.approx([0.8] * len(away), abs=0.005)


def test_only_named_bodies_that_never_move_have_lines() -> None:
    bodies = cube("a"), cube("b"), cube("c", 1.0)
    assert len(lines(*bodies)) == 2
    assert len(lines(*bodies, names=("b", "c"))) == 1


def test_a_large_world_has_some_lines() -> None:
    assert len(lines(*(cube(f"{number}") for number in range(100)))) == 60
