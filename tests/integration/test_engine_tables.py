"""How many joints PyBullet keeps apart: all that the audit lets through, and not one more."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.core.errors import EngineError
from sim_action.core.workspace import Workspace
from sim_action.engines import ENGINES
from sim_action.robot.audit.joints import MAX_JOINTS, MAX_MOVING_JOINTS
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.urdf import read_urdf
from sim_action.state.command import JointTargets
from sim_action.state.observation import Observation
from sim_action.state.trace_records import Channels
from sim_action.world import Physics, World
from sim_action.world.scene import Scene

pytestmark = pytest.mark.pybullet

INERTIAL = (
    '<inertial><mass value="{}"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>'
    '<collision><geometry><box size="0.1 0.1 0.002"/></geometry></collision>'
)
SPEED = 0.5


def comb(fixed: int, moving: int) -> str:
    """A base that many plates lie upon, those that turn last."""
    kinds = ["fixed"] * fixed + ["revolute"] * moving
    parts = (
        f'<link name="l{n}">{INERTIAL.format(0.01)}</link>\n'
        f'<joint name="j{n}" type="{kind}"><parent link="base"/><child link="l{n}"/>'
        f'<origin xyz="0 0 {0.01 * (n + 1):.2f}"/><axis xyz="0 0 1"/>'
        '<limit lower="-3" upper="3" effort="50" velocity="9"/></joint>\n'
        for n, kind in enumerate(kinds)
    )
    return f'<robot name="comb"><link name="base">{INERTIAL.format(100)}</link>\n{"".join(parts)}</robot>'


def start(joint: str) -> float:
    return 0.1 + int(joint.removeprefix("j")) / 1000


def after(folder: Path, urdf: str, base: str, steps: int) -> list[Observation]:
    """As it begins, and after so many steps with the last joint turning."""
    path = folder / "comb.urdf"
    path.write_text(urdf)
    model = read_urdf(path)
    names = [joint.name for joint in model.moving_joints]
    robot = Robot.model_validate({"model": "comb.urdf", "base": base, "joints": {n: start(n) for n in names}})
    backend = ENGINES["pybullet"].load()(
        Scene(robot, model, World(), Physics(), Workspace(folder, folder)), Channels(contacts=True)
    )
    try:
        begun = backend.observe(0, contacts=False)
        targets = JointTargets(velocity={names[-1]: SPEED})
        backend.advance(0, [targets, *[None] * (steps - 1)])
        return [begun, backend.observe(steps, contacts=False)]
    finally:
        backend.close()


@pytest.mark.parametrize("base", ["free", "fixed"])
@pytest.mark.parametrize(
    ("fixed", "moving"), [(0, MAX_MOVING_JOINTS), (MAX_JOINTS - MAX_MOVING_JOINTS, MAX_MOVING_JOINTS), (126, 1)]
)
def test_as_many_joints_as_there_may_be_are_where_they_should_be(
    fixed: int, moving: int, base: str, tmp_path: Path
) -> None:
    begun, turned = after(tmp_path, comb(fixed, moving), base, steps=24)
    assert len(begun.joints) == moving
    for name, state in begun.joints.items():
        assert state.position == pytest.approx(start(name), abs=1e-12)
    *_, last = turned.joints
    assert turned.joints[last].velocity == pytest.approx(SPEED, rel=0.05)
    assert turned.joints[last].position == pytest.approx(start(last) + SPEED * 24 / 240, rel=0.05)
    # What lies beyond the table of positions is that of velocities, and the base's come first in it.
    assert begun.twist.linear_xyz == (0, 0, 0)
    assert turned.twist.linear_xyz == pytest.approx((0, 0, 0), abs=1e-3)


@pytest.mark.parametrize(("fixed", "moving"), [(0, MAX_MOVING_JOINTS + 1), (MAX_JOINTS, 1), (MAX_JOINTS + 1, 0)])
def test_one_more_is_refused(fixed: int, moving: int, tmp_path: Path) -> None:
    path = tmp_path / "comb.urdf"
    path.write_text(comb(fixed, moving))
    assert "many-joints" in {note.rule for note in read_urdf(path).findings}
    with pytest.raises(EngineError, match=r"PyBullet supports at most 12[17]: set backend: mujoco, or merge links"):
        after(tmp_path, comb(fixed, moving), "fixed", steps=1)
