"""What a run did not come to."""

from __future__ import annotations

from sim_action.simulation.unreached_events import missed
from sim_action.world import World

WORLD = World.model_validate(
    {
        "objects": (
            {"name": "gate", "box": (1, 1, 1), "path": ({"at": 2}, {"at": 4, "x": 1})},
            {"name": "ball", "sphere": {"radius": 1}, "mass": 1, "appears": 3},
            {"name": "wall", "box": (1, 1, 1)},
        ),
        "disturbances": ({"at": 0.5, "velocity": (1, 0, 0)}, {"at": 5, "for": 1, "force": (1, 0, 0)}),
    }
)


def test_what_came_in_time_is_not_told() -> None:
    assert list(missed(WORLD, 5.1)) == []
    assert list(missed(World(), 0.1)) == []


def test_what_never_came_is_told_each_once() -> None:
    assert list(missed(WORLD, 3.0)) == [
        "the run was over at 3 s, and body 'ball' appears at 3 s: it never came to that",
        "the run was over at 3 s, and world.disturbances[1] begins at 5 s: it never came to that",
    ]
    assert len(list(missed(WORLD, 0.5))) == 4
