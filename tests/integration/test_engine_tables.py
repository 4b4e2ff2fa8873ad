"""How many joints PyBullet keeps apart: all that the audit lets through, and not one more."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from sim_action.core.errors import EngineError
from sim_action.robot.audit.joints import MAX_JOINTS, MAX_MOVING_JOINTS
from sim_action.robot.model.robot_spec import Robot
from sim_action.state.command import JointTargets
from sim_action.state.observation import Observation
from tests.integration.engines import at, running, scene_of
from tests.physics.robots import collision, inertial, joint, link, robot

pytestmark = pytest.mark.pybullet

SPEED = 0.5


def plate(name: str, mass: float) -> str:
    return link(name, inertial(mass, (0.1, 0.1, 0.1)) + collision('<box size="0.1 0.1 0.002"/>'))


def comb(fixed: int, moving: int) -> str:
    """A base that many plates lie upon, those that turn last."""
    limit = 'lower="-3" upper="3" effort="50" velocity="9"'
    parts = [plate("base", 100)]
    for n, kind in enumerate(["fixed"] * fixed + ["revolute"] * moving):
        up = (0.0, 0.0, 0.01 * (n + 1))
        parts += [plate(f"l{n}", 0.01), joint(f"j{n}", kind, "base", f"l{n}", up, axis=(0.0, 0.0, 1.0), limit=limit)]
    return robot(*parts)


def start(joint: str) -> float:
    return 0.1 + int(joint.removeprefix("j")) / 1000


def after(folder: Path, urdf: str, base: str, steps: int) -> list[Observation]:
    """As it begins, and after so many steps with the last joint turning."""
    names = re.findall(r'joint name="(j\d+)" type="revolute"', urdf)
    placed = Robot.model_validate({"model": "robot.urdf", "base": base, "joints": {n: start(n) for n in names}})
    with running("pybullet", scene_of(folder, urdf, placed), contacts=True) as backend:
        begun = backend.observe(0, contacts=False)
        backend.advance(0, [JointTargets(velocity={names[-1]: SPEED}), *[None] * (steps - 1)])
        return [begun, backend.observe(steps, contacts=False)]


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
    urdf = comb(fixed, moving)
    assert "many-joints" in {note.rule for note in scene_of(tmp_path, urdf, at()).model.findings}
    with pytest.raises(EngineError, match=r"PyBullet supports at most 12[17]: set backend: mujoco, or merge links"):
        after(tmp_path, urdf, "fixed", steps=1)
