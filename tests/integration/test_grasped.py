"""A grip on every engine: it holds with the force of the fingers, and what is only pushed or carried is not held."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from sim_action.state.verdict import Verdict
from tests.integration.engines import on_every_engine
from tests.simulated import simulated

GRIPPER = Path(__file__).parents[2] / "examples/assertions/gripper.urdf"
CUBE = {"name": "cube", "box": [0.05, 0.05, 0.05], "mass": 0.2, "pose": {"z": 0.025}}


def run(
    folder: Path, engine: str, efforts: dict[str, float], *asked: dict[str, Any], **cube: Any
) -> tuple[Verdict, ...]:
    commands = {"commands": [{"joints": [{"at": 0.0, "effort": efforts}], "interpolation": "hold"}]} if efforts else {}
    scenario = {
        "name": "a gripper",
        "robot": {"model": str(GRIPPER), "base": "fixed", "pose": {"z": 0}, "self_collision": False},
        "world": {"objects": [{**CUBE, **cube}]},
        "expect": [{"grasped": {"object": "cube", "by": ["*_finger"], **one}, "severity": "warning"} for one in asked],
        "allow": ["warnings-only"],
        "duration": 0.6,
        "time_limit": 0.6,
        "backend": engine,
        **commands,
    }
    return simulated(folder, scenario, outside=True).verdicts


@on_every_engine
def test_two_fingers_hold_a_cube_with_their_effort(engine: str, tmp_path: Path) -> None:
    efforts = {"left_finger_joint": 5.0, "right_finger_joint": 5.0}
    # At first the fingers strike with more; half a second of 5 N is the grip.
    held, weak = run(tmp_path, engine, efforts, {"at_least": 4.95, "for": 0.3}, {"at_least": 5.05, "for": 0.3})
    assert (held.passed, weak.passed) == (True, False)
    assert held.unit == "s"


@on_every_engine
def test_one_finger_pushes_and_does_not_hold(engine: str, tmp_path: Path) -> None:
    # The cube is too heavy to be pushed against the other finger.
    (pushed,) = run(tmp_path, engine, {"left_finger_joint": 5.0}, {"for": 0.1}, mass=2)
    assert not pushed.passed
    assert "only left_finger touched it" in pushed.message


@on_every_engine
@pytest.mark.parametrize("by", [["palm", "left_finger"], ["palm", "*_finger"]])
def test_what_lies_on_a_link_is_not_held(engine: str, by: list[str], tmp_path: Path) -> None:
    (carried,) = run(tmp_path, engine, {}, {"by": by, "for": 0.1}, pose={"x": 0.0, "z": 0.156})
    assert not carried.passed
    assert "only palm touched it" in carried.message
