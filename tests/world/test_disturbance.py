"""What a scenario says of disturbances."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from sim_action.world import Disturbance

FORCE: dict[str, Any] = {"at": "2 s", "for": "100 ms", "force": ("10 N", 0, "1 kN")}


def test_units_are_read() -> None:
    disturbance = Disturbance.model_validate(FORCE)
    assert disturbance.force == (10.0, 0.0, 1000.0)
    assert disturbance.end == pytest.approx(2.1)
    push = Disturbance.model_validate({"at": 4, "velocity": (0, "36 km/h", 0), "body": "ball"})
    assert push.velocity == (0.0, 10.0, 0.0)
    assert push.end == 4.0


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"at": 1}, "needs either 'force' and 'torque'"),
        ({**FORCE, "velocity": (1, 0, 0)}, "needs either 'force' and 'torque'"),
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
        Disturbance.model_validate(keys)
