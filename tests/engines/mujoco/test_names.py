"""What the engine says is told with the names of the scenario."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import pytest

from sim_action.engines.mujoco.geoms import add_object, with_user_names
from sim_action.world import Body, World
from sim_action.world.parts import HullPart
from sim_action.world.scene import Scene
from tests.traces import scene

mujoco = pytest.importorskip("mujoco")
NAMES: Final = ("h", "h f/2", "hut")


def made() -> Scene:
    return replace(scene(), world=World(objects=tuple(Body(name=name, box=(1, 1, 1)) for name in NAMES)))


@pytest.mark.parametrize(
    ("said", "told"),
    [
        ("Error: volume of mesh object/h/0.3 is 0", "Error: volume of mesh 'h' is 0"),
        ("Error: bad\nElement name 'object/h f/2/0', id 4", "Error: bad Element name 'h f/2', id 4"),
        ("object/hut and 'object/h'", "'hut' and 'h'"),
        (
            "body 'robot/base_footprint', joint robot/wheel_left_joint",
            "body 'base_footprint', joint 'wheel_left_joint'",
        ),
        ("object/hall/0", "object/hall/0"),
        ("nothing of ours", "nothing of ours"),
    ],
)
def test_names_are_those_of_the_user(said: str, told: str) -> None:
    assert with_user_names(said, made()) == told


def test_so_is_what_it_says_of_a_hull_that_it_refuses() -> None:
    spec = mujoco.MjSpec()
    flat = HullPart(((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 1.0, 0.0)))
    list(add_object(spec, Body(name="h", box=(1, 1, 1), mass=1.0), [flat]))
    with pytest.raises(ValueError, match="object/h") as refused:
        spec.compile()
    told = with_user_names(str(refused.value), made())
    assert "'h'" in told
    assert "object/" not in told
