"""Bodies on paths that pass through other bodies of the world are noted, without an engine."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.scenario.world_checks import DEPTH
from sim_action.simulation.path_crossings import path_crossings
from sim_action.world import World
from tests.traces import scene

WALL = {"name": "wall", "box": (0.1, 2.0, 0.5)}


def notes(*objects: dict[str, Any], end: float = 10.0) -> list[str]:
    made = replace(scene(), world=World.model_validate({"objects": objects}))
    return list(path_crossings(made, end))


def along_x(*points: tuple[float, float], name: str = "agv", **keys: Any) -> dict[str, Any]:
    """A box of 0.4 m on a path of (s, m)."""
    path = tuple({"at": at, "x": x} for at, x in points)
    return {"name": name, "box": (0.4, 0.4, 0.2), "path": path, **keys}


def test_a_body_through_a_wall_is_noted() -> None:
    # It is deep in the wall from x = -0.25 + 0.005 on.
    (note,) = notes(WALL, along_x((0, -2), (4, 2)))
    assert note == (
        "body 'agv' passes through body 'wall' on its path, at 1.77 s: nothing stops it, and no assertion judges two "
        "bodies of the world"
    )


@pytest.mark.parametrize(
    "objects",
    [
        (WALL,),
        (along_x((0, -2), (4, 2)),),
        (WALL, along_x((0, -2), (4, -0.25))),
        (WALL, along_x((0, -2), (4, -0.25 + 0.8 * DEPTH))),
        (WALL, along_x((0, -2), (4, 2), pose={"z": 0.61})),
        (WALL, along_x((0, -2), (20, 2), (30, 3))),
        ({**WALL, "mass": 1.0}, along_x((0, -2), (4, 2))),
    ],
    ids=["no path", "alone", "touches", "a little inside", "above", "too late", "a body with a mass"],
)
def test_other_bodies_are_not(objects: tuple[dict[str, Any], ...]) -> None:
    assert notes(*objects, end=8.0) == []


def test_two_paths_may_cross() -> None:
    other = along_x((0, 2), (4, -2), name="other")
    (note,) = notes(along_x((0, -2), (4, 2)), other)
    assert note.startswith("body 'other' passes through body 'agv' on its path, at 1.8")
    assert notes(along_x((0, -2), (4, 1)), along_x((4, 2), (5, 1), (8, -2), name="other"), end=3.9) == []


def test_a_body_may_appear_in_the_way() -> None:
    # At 2 s it is already behind the wall.
    assert notes({**WALL, "appears": 3.0}, along_x((0, -2), (4, 2))) == []
    assert len(notes({**WALL, "appears": 3.0}, along_x((0, -2), (2, 0)))) == 1


def test_each_body_is_noted_once_in_the_order_of_time() -> None:
    posts = [
        {"name": f"post {number}", "cylinder": {"radius": 0.1, "height": 1.0}, "pose": {"x": -number}}
        for number in range(3)
    ]
    found = notes(*posts, along_x((0, -4), (4, 2), (8, -4), loop=True))
    assert [note.split("'")[3] for note in found] == ["post 2", "post 1", "post 0"]


@given(st.floats(0.02, 1.0), st.floats(0.02, 1.0), st.floats(-2, 2), st.floats(-1, 1), st.booleans())
def test_balls_are_noted_where_they_overlap(one: float, other: float, y: float, stop: float, loops: bool) -> None:
    path = [{"at": 0, "x": -3}, {"at": 6, "x": stop}, *([{"at": 12, "x": -3}] if loops else [])]
    mover = {"name": "agv", "sphere": {"radius": one}, "pose": {"y": y, "z": 2}, "path": tuple(path), "loop": loops}
    ball = {"name": "ball", "sphere": {"radius": other}, "pose": {"z": 2}}
    nearest = (min(stop, 0.0) ** 2 + y**2) ** 0.5
    deep = one + other - nearest
    if abs(deep - DEPTH) > 1e-3 and one > 2 * DEPTH:
        # Frames are 1/60 s apart, in which it moves up to 3 cm: grazes may be missed.
        assert bool(notes(ball, mover, end=12.0)) == (deep > DEPTH) or deep < 2 * DEPTH
