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
TO_5_M = "[5, 0, 0.05], [0, 0, 0, 1]"


def verdict(folder: Path, pose: str, time: float, limit: str, **keys: Any) -> dict[str, Any]:
    """On a limit of 1 for a robot that is put at a pose at a time."""
    jump = f"pybullet.resetBasePositionAndOrientation(body, {pose}, physicsClientId=client)"
    (folder / "teleport.py").write_text(SCRIPT.format(time=time, jump=jump))
    scenario = {
        "name": "teleport",
        "robot": {"model": "turtlebot3_burger"},
        "commands": {"rate": "10 Hz", "script": "teleport.py"},
        "expect": [{"max_speed": {limit: 1}}],
        "time_limit": 2,
        "duration": 2,
        "backend": "pybullet",
        **keys,
    }
    (folder / "teleport.sim.yml").write_text(json.dumps(scenario))
    ran = sim_action(folder, "run", "teleport.sim.yml")
    assert ran.returncode == 1, ran.stdout + ran.stderr
    (expectation,) = outcomes(folder)[0]["expectations"]
    return dict(expectation["verdict"])


@pytest.mark.parametrize("time", [0.0, 0.4, 1.0])
def test_a_teleport_breaks_a_limit_of_speed(time: float, tmp_path: Path) -> None:
    jumped = verdict(tmp_path, TO_5_M, time, "linear")
    assert not jumped["passed"]
    assert jumped["time"] == pytest.approx(time + 1 / 240)
    assert jumped["measured"] == pytest.approx(1200, rel=0.02)
    assert jumped["message"].startswith("jumped 5.0")


def test_a_turn_at_once_breaks_a_limit_of_the_turn_rate(tmp_path: Path) -> None:
    turned = verdict(tmp_path, "[0, 0, 0.05], [0, 0, 1, 0]", 0.5, "angular")
    assert turned["message"].startswith("jumped by 180 deg")


def test_a_teleport_past_a_wall_is_a_jump_and_no_missed_contact(tmp_path: Path) -> None:
    """No rate of the physics would see it."""
    wall = {"name": "wall", "box": [0.002, 2, 2], "pose": {"x": 2}}
    jumped = verdict(tmp_path, TO_5_M, 0.5, "linear", world={"objects": [wall]})
    assert jumped["message"].startswith("jumped 5.0")
