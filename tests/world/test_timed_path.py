"""What a scenario says of bodies that move or appear."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from sim_action.core.field_types import Placement
from sim_action.world import Body

GATE: dict[str, Any] = {"name": "gate", "box": (0.1, 1, 1), "pose": {"x": 1, "y": 2}}


def body(**keys: Any) -> Body:
    return Body.model_validate({**GATE, **keys})


def test_a_body_begins_at_its_pose_or_at_the_first_point_of_its_path() -> None:
    assert body().beginning == Placement(x=1.0, y=2.0)
    moving = body(path=({"at": "1 s", "y": 3}, {"at": "2 s", "x": 5, "z": 1}))
    assert moving.beginning == Placement(x=1.0, y=3.0)


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"path": ({"at": 0},)}, "two points"),
        ({"loop": True}, "'loop' goes with a 'path'"),
        ({"path": ({"at": 0}, {"at": 1, "x": 2}), "mass": 1}, "leave 'mass' out"),
        ({"path": ({"at": 0}, {"at": 1, "x": 2}), "appears": 1}, "there from the start"),
        ({"path": ({"at": 0}, {"at": 1, "x": 2}), "loop": True}, "ends where it begins"),
        ({"path": ({"at": 0}, {"at": 1, "yaw": "180 deg"}), "loop": True}, "ends where it begins"),
        ({"path": ({"at": -1}, {"at": 1, "x": 2})}, "greater than or equal to 0"),
        ({"path": ({"x": 1}, {"at": 1, "x": 2})}, "Field required"),
        ({"appears": 0}, "greater than 0"),
        ({"path": ({"at": 0}, {"at": 1e5, "y": 1e6})}, "less than or equal to 100000"),
    ],
)
def test_motions_that_do_not_fit_together_are_refused(keys: dict[str, Any], told: str) -> None:
    with pytest.raises(ValidationError, match=told):
        body(**keys)


@pytest.mark.parametrize("end", [{"x": 1, "yaw": "360 deg"}, {"x": 1, "yaw": "-720 deg"}, {"x": 1}])
def test_a_loop_may_end_after_whole_turns(end: dict[str, Any]) -> None:
    assert body(path=({"at": 0}, {"at": 1, "x": 2}, {"at": 2, **end}), loop=True).loop
