"""A script that sets the pose of the robot: no velocity explains the jump."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.integration.conftest import outcomes, sim_action

pytestmark = pytest.mark.pybullet

SCRIPT = """
import pybullet
from sim_action import Twist


def control(seen):
    if abs(seen.time - {time}) < 1e-6:
        for client in range(8):
            if pybullet.isConnected(client):
                for number in range(pybullet.getNumBodies(physicsClientId=client)):
                    body = pybullet.getBodyUniqueId(number, physicsClientId=client)
                    if pybullet.getNumJoints(body, physicsClientId=client):
                        {jump}
    return Twist.planar(0)
"""
JUMP = "pybullet.resetBasePositionAndOrientation(body, [{x}, 0, 0.05], [0, 0, {qz}, {qw}], physicsClientId=client)"


def verdicts(folder: Path, jump: str, time: float, *expected: Any, **keys: Any) -> list[dict[str, Any]]:
    (folder / "teleport.py").write_text(SCRIPT.format(time=time, jump=jump))
    scenario = {
        "name": "teleport",
        "robot": {"model": "turtlebot3_burger"},
        "commands": {"rate": "10 Hz", "script": "teleport.py"},
        "expect": list(expected),
        "time_limit": 2,
        "duration": 2,
        "backend": "pybullet",
        **keys,
    }
    (folder / "teleport.sim.yml").write_text(json.dumps(scenario))
    ran = sim_action(folder, "run", "teleport.sim.yml")
    assert ran.returncode == 1, ran.stdout + ran.stderr
    found: list[dict[str, Any]] = outcomes(folder)
    return [expectation["verdict"] for expectation in found[0]["expectations"]]


@pytest.mark.parametrize("time", [0.0, 0.4, 1.0])
def test_a_teleport_breaks_a_limit_of_speed(time: float, tmp_path: Path) -> None:
    jump = JUMP.format(x=5, qz=0, qw=1)
    (verdict,) = verdicts(tmp_path, jump, time, {"max_speed": {"linear": 1}})
    assert not verdict["passed"]
    assert verdict["time"] == pytest.approx(time + 1 / 240)
    assert verdict["measured"] == pytest.approx(1200, rel=0.02)
    assert verdict["message"].startswith("jumped 5.0")


def test_a_turn_at_once_breaks_a_limit_of_the_turn_rate(tmp_path: Path) -> None:
    jump = JUMP.format(x=0, qz=1, qw=0)
    (verdict,) = verdicts(tmp_path, jump, 0.5, {"max_speed": {"angular": 1}})
    assert verdict["message"].startswith("jumped by 180 deg")


def test_a_teleport_past_a_wall_is_a_jump_and_no_missed_contact(tmp_path: Path) -> None:
    """No rate of the physics would see it."""
    wall = {"name": "wall", "box": [0.002, 2, 2], "pose": {"x": 2}}
    jump = JUMP.format(x=5, qz=0, qw=1)
    (verdict,) = verdicts(tmp_path, jump, 0.5, {"max_speed": {"linear": 1}}, world={"objects": [wall]})
    assert verdict["message"].startswith("jumped 5.0")
