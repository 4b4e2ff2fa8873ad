"""Poses and twists of links, computed from the base and the joints, against those of the engines themselves."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final, Literal

import pytest

from sim_action.core import geometry
from sim_action.core.field_types import Placement
from sim_action.core.workspace import Workspace
from sim_action.engines.engine import Engine
from sim_action.robot.model.kinematics import link_motion
from sim_action.robot.model.robot_model import RobotModel
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model
from sim_action.state.command import JointTargets
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.world import Physics, World
from sim_action.world.scene import Scene
from tests.integration.engines import advance, on_every_engine, push, running, scene_of
from tests.integration.test_probe import INERTIAL, same

_LIMIT: Final = '<limit lower="-3" upper="3" effort="500" velocity="20"/>'
_TURNED: Final = '<origin xyz="0.2 -0.1 0.3" rpy="0.3 -0.2 0.5"/>'


def _joint(name: str, kind: str, parent: str, more: str = _LIMIT, axis: str = "0.6 0 0.8") -> str:
    """Return a joint of a kind, and the link NAME_link below it."""
    ends = f'<parent link="{parent}"/><child link="{name}_link"/><axis xyz="{axis}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{_TURNED}{more}</joint><link name="{name}_link">{INERTIAL}</link>'


# One joint of each kind, with a turned link on it.
ZOO: Final = "".join(
    (
        f'<robot name="zoo"><link name="base">{INERTIAL}</link>',
        _joint("hinge", "revolute", "base"),
        _joint("slide", "prismatic", "hinge_link"),
        _joint("turn", "continuous", "slide_link", '<limit effort="500" velocity="20"/>'),
        _joint("weld", "fixed", "turn_link", ""),
        _joint("copy", "revolute", "base", f'{_LIMIT}<mimic joint="hinge" multiplier="-0.5" offset="0.2"/>'),
        _joint("copied_slide", "prismatic", "copy_link", f'{_LIMIT}<mimic joint="slide" multiplier="2"/>'),
        _joint("ball", "ball", "base", ""),
        _joint("after_ball", "fixed", "ball_link", ""),
        _joint("planar", "planar", "base", ""),
        _joint("universal", "universal", "planar_link", '<axis2 xyz="0 1 0"/>', "1 0 0"),
        _joint("floating", "floating", "base", ""),
        _joint("after_floating", "revolute", "floating_link"),
        "</robot>",
    )
)
TARGETS: Final = JointTargets(velocity={"hinge": 0.7, "slide": 0.2, "turn": -1.5, "after_floating": 0.5})

# Joints in series with anchors and references, a ball joint with an anchor, and an equality.
NATIVE: Final = """\
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="base" pos="0 0 3" euler="0.2 0.1 0.3">{free}
      <geom type="box" size="0.2 0.1 0.1" pos="0.05 0 0"/>
      <body name="shoulder" pos="0 0.1 0.5" euler="0.1 0.2 0.3">
        <joint name="swing" axis="0 1 0" pos="0.1 0 -0.2" ref="0.4"/>
        <joint name="lift" type="slide" axis="0.6 0 0.8" ref="-0.1"/>
        <joint name="twist" axis="1 0 0" pos="0 0.3 0"/>
        <geom type="sphere" size="0.1" pos="0.2 0 0.1"/>
        <body name="hand" pos="0.3 0 0" euler="0 0.4 0">
          <joint name="ball" type="ball" pos="0.05 -0.1 0.2"/>
          <geom type="capsule" size="0.05 0.2" pos="0 0.1 0"/>
          <body name="tip" pos="0.1 0.2 0.3"/>
        </body>
      </body>
      <body name="follower" pos="-0.3 0 0">
        <joint name="copy" axis="0 0 1"/>
        <geom type="box" size="0.1 0.1 0.1" pos="0 0.1 0"/>
      </body>
    </body>
  </worldbody>
  <equality><joint joint1="copy" joint2="twist" polycoef="0.1 0.5 0 0 0"/></equality>
  <actuator><velocity joint="swing" kv="5"/><velocity joint="twist" kv="5"/></actuator>
</mujoco>
"""


def disagreements(backend: Engine, model: RobotModel, now: Observation, trace: Trace) -> Iterator[str]:
    """Yield the links whose pose or twist differs between an observation, the last row of a trace, and the engine."""
    for link in engine_links(backend, model):
        pose, twist = backend.link_pose(link), backend.link_twist(link)
        state = now.links[link]
        if not same(state.pose, pose):
            yield f"{link}: {state.pose}, but {pose}"
        motion = link_motion(model, trace, link)
        last: Any = tuple(map(tuple, (motion.position_xyz[-1].tolist(), motion.orientation_xyzw[-1].tolist())))
        if not same(geometry.Pose(*last), pose):
            yield f"{link} in the trace: {last}, but {pose}"
        speeds = (*twist.linear_xyz, *twist.angular_xyz)
        in_trace = (*motion.linear_xyz[-1].tolist(), *motion.angular_xyz[-1].tolist())
        for computed in ((*state.twist.linear_xyz, *state.twist.angular_xyz), in_trace):
            if max(abs(a - b) for a, b in zip(computed, speeds, strict=True)) > 1e-8 * (1 + max(map(abs, speeds))):
                yield f"{link}: {computed}, but {speeds}"


def engine_links(backend: Engine, model: RobotModel) -> Iterable[str]:
    """Return the links of the engine: not all engines have those between joints in series."""
    between = {joint.child for joint in model.joints if joint.ball or joint.series}
    return [link.name for link in model.links if link.name not in between or link.mass is not None]


def assert_agree(engine: str, scene: Scene, targets: JointTargets, *, pushed: bool) -> None:
    with running(engine, scene) as backend:
        if pushed:
            push(backend, (0.5, 0, 0), (0.3, 0.5, 2))
        trace = advance(backend, 0, 100, targets)
        now = backend.observe(100, contacts=False)
        assert [*disagreements(backend, scene.model, now, trace)] == []
        moving = [name for name, state in now.joints.items() if abs(state.velocity) > 1e-3]
        assert len(moving) > len(now.joints) // 2


@on_every_engine
@pytest.mark.parametrize("base", ["fixed", "free"])
def test_links_below_joints_of_all_kinds(engine: str, base: Literal["fixed", "free"], tmp_path: Path) -> None:
    robot = Robot(model="robot.urdf", base=base, pose=Placement(x=21, y=2, z=9, roll=0.3, yaw=1.0))
    assert_agree(engine, scene_of(tmp_path, ZOO, robot), TARGETS, pushed=base == "free")


@pytest.mark.parametrize("free", ["", "<freejoint/>"])
def test_links_of_mjcf(free: str, tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo, which is not installed")
    (tmp_path / "robot.xml").write_text(NATIVE.format(free=free))
    robot, workspace = Robot(model="robot.xml"), Workspace(tmp_path, tmp_path)
    scene = Scene(robot, load_model(robot, workspace), World(), Physics(), workspace)
    assert_agree("mujoco", scene, JointTargets(velocity={"swing": 1.0, "twist": -2.0}), pushed=bool(free))


@on_every_engine
@pytest.mark.parametrize("name", ["kuka_iiwa/model.urdf", "franka_panda/panda.urdf", "a1/a1.urdf", "ur5e_gripper"])
def test_links_of_robots(engine: str, name: str, tmp_path: Path) -> None:
    folder = tmp_path
    if "/" in name:
        folder = Path(pytest.importorskip("pybullet_data").getDataPath()).resolve()
    base: Literal["fixed", "free"] = "free" if "a1" in name else "fixed"
    robot, workspace = Robot(model=name, base=base, pose=Placement(z=2.0, pitch=0.4)), Workspace(folder, folder)
    scene = Scene(robot, load_model(robot, workspace), World(), Physics(), workspace)
    targets = {joint.name: 0.3 * math.cos(n) for n, joint in enumerate(scene.model.motor_joints) if not joint.mimic}
    assert_agree(engine, scene, JointTargets(velocity=targets), pushed=base == "free")
