"""What `robot.allow` lets go is a robot that the engine takes, steps, and that stays physics."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from sim_action.core.workspace import Workspace
from sim_action.engines import ENGINES, chosen, installed
from sim_action.engines.engine import Engine
from sim_action.robot.model.findings import ALLOWABLE
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.urdf import read_urdf
from sim_action.state.command import JointTargets
from sim_action.state.trace_records import Channels
from sim_action.world import Physics, World
from sim_action.world.scene import Scene
from tests.robot.bad_models import BAD_MODELS, GOOD, BadModel

LIMIT = '    <limit lower="-1" upper="2" effort="10" velocity="3"/>\n'
SECOND = 240


def backend(folder: Path, text: str, engine: str | None = None) -> Engine:
    path = folder / "robot.urdf"
    path.write_text(text, encoding="utf-8")
    robot = Robot(model="robot.urdf", base="fixed", allow=ALLOWABLE)
    model = read_urdf(path, allow=ALLOWABLE)
    return ENGINES[engine or chosen("auto")].load()(
        Scene(robot, model, World(), Physics(), Workspace(folder, folder)), Channels(contacts=True)
    )


@pytest.mark.parametrize("engine", installed())
@pytest.mark.parametrize("bad", [bad for bad in BAD_MODELS if bad.rule in ALLOWABLE], ids=lambda bad: bad.name)
def test_what_was_let_go_can_be_simulated(bad: BadModel, engine: str, tmp_path: Path) -> None:
    it = backend(tmp_path, bad.text, engine)
    try:
        it.advance(0, [None] * SECOND)
        seen = it.observe(SECOND, contacts=True)
    finally:
        it.close()
    joints = (value for state in seen.joints.values() for value in (state.position, state.velocity))
    assert all(map(math.isfinite, (*seen.pose.position_xyz, *seen.twist.angular_xyz, *joints)))


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
@pytest.mark.parametrize(
    "limit", ["", "<limit/>", '<limit lower="2" upper="-1"/>', '<limit effort="90" velocity="9"/>']
)
def test_a_joint_without_limits_moves_without(kind: str, limit: str, tmp_path: Path) -> None:
    text = GOOD.replace(LIMIT, limit).replace('"revolute"', f'"{kind}"')
    assert text.count("limit") == limit.count("limit")
    engine = backend(tmp_path, text)
    try:
        engine.advance(0, [JointTargets(velocity={"shoulder": 6.0}), *[None] * (SECOND - 1)])
        assert engine.observe(SECOND, contacts=False).joints["shoulder"].position > 4.0
    finally:
        engine.close()
