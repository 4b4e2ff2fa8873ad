"""What the audit lets through, or can be told to let through, is a robot that the engine takes and steps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sim_action.engines import installed
from sim_action.robot.model.findings import ALLOWABLE, RULES
from sim_action.robot.model.robot_spec import Robot
from sim_action.state.command import JointTargets
from sim_action.world.scene import Scene
from tests.integration.engines import scene_of, travelled
from tests.robot.bad_models import BAD_MODELS, GOOD, BadModel

LIMIT = '    <limit lower="-1" upper="2" effort="10" velocity="3"/>\n'
SECOND = 240


def scene(folder: Path, text: str, base: str = "fixed") -> Scene:
    robot = Robot.model_validate({"model": "robot.urdf", "base": base, "allow": ALLOWABLE})
    return scene_of(folder, text, robot, allow=ALLOWABLE)


# PyBullet alone refuses a model with many joints.
TAKEN = [
    bad
    for bad in BAD_MODELS
    if bad.rule != "many-joints" and (bad.rule in ALLOWABLE or RULES[bad.rule].level == "warning")
]


@pytest.mark.parametrize("engine", installed())
@pytest.mark.parametrize("base", ["fixed", "free"])
@pytest.mark.parametrize("bad", TAKEN, ids=lambda bad: bad.name)
def test_what_was_let_go_can_be_simulated(bad: BadModel, base: str, engine: str, tmp_path: Path) -> None:
    placed = scene(tmp_path, bad.text, base)
    spun = {joint.name: 1.0 for joint in placed.model.motor_joints if joint.mimic is None}
    trace = travelled(engine, placed, SECOND, JointTargets(velocity=spun if base == "free" else {}), contacts=True)
    joints = (trace.joint_position[-1], trace.joint_velocity[-1])
    assert np.isfinite(np.concatenate((trace.base_position_xyz[-1], trace.base_angular_xyz[-1], *joints))).all()


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
@pytest.mark.parametrize(
    "limit", ["", "<limit/>", '<limit lower="2" upper="-1"/>', '<limit effort="90" velocity="9"/>']
)
def test_a_joint_without_limits_moves_without(kind: str, limit: str, tmp_path: Path) -> None:
    text = GOOD.replace(LIMIT, limit).replace('"revolute"', f'"{kind}"')
    assert text.count("limit") == limit.count("limit")
    turns = JointTargets(velocity={"shoulder": 6.0})
    assert travelled(installed()[0], scene(tmp_path, text), SECOND, turns).joint_position[-1, 0] > 4.0
