"""What sensors ask an engine for: on every engine, against analytic results."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from sim_action.core import geometry
from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_spec import Robot
from sim_action.state.command import JointTargets
from sim_action.world import Body, Sphere, World
from tests.integration.engines import advance, at, on_every_engine, push, running, scene_of

pytestmark = on_every_engine

INERTIAL = (
    '<inertial><origin xyz="0.1 0.05 -0.02" rpy="0.3 0.2 0.1"/><mass value="1"/>'
    '<inertia ixx="0.01" iyy="0.012" izz="0.014" ixy="0" ixz="0" iyz="0"/></inertial>'
)
# Two hinges, a slide, and a link that is welded on; no centre of mass is at the origin of its link.
ARM = f"""
<robot name="arm">
  <link name="base">{INERTIAL}</link>
  <joint name="turn" type="continuous"><parent link="base"/><child link="upper"/>
    <origin xyz="0.1 0.2 0.3" rpy="0.1 0 0.4"/><axis xyz="0 0 1"/><limit effort="1000" velocity="50"/></joint>
  <link name="upper">{INERTIAL}</link>
  <joint name="bend" type="revolute"><parent link="upper"/><child link="lower"/>
    <origin xyz="0.5 0 0"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1000" velocity="50"/></joint>
  <link name="lower">{INERTIAL}</link>
  <joint name="slide" type="prismatic"><parent link="lower"/><child link="hand"/>
    <origin xyz="0.4 0 0" rpy="0 0.5 0"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="1000" velocity="50"/></joint>
  <link name="hand">{INERTIAL}</link>
  <joint name="weld" type="fixed"><parent link="hand"/><child link="tip"/><origin xyz="0.2 0 0.1" rpy="0 0 1"/></joint>
  <link name="tip">{INERTIAL}</link>
</robot>
"""
MOVING = JointTargets(velocity={"turn": 0.7, "bend": -0.3, "slide": 0.1})
LINKS = ("base", "upper", "lower", "hand", "tip")


def same(pose: Pose, other: Pose) -> bool:
    apart = geometry.compose(geometry.inverse(pose), other)
    return max(map(abs, (*apart.position_xyz, *apart.orientation_xyzw[:3]))) < 1e-9


@pytest.mark.parametrize("bolted", [True, False])
def test_a_link_is_where_the_joints_put_it(engine: str, bolted: bool, tmp_path: Path) -> None:
    robot = Robot(model="robot.urdf", base="fixed" if bolted else "free", pose=Placement(x=21, y=2, z=9, roll=0.3))
    scene = scene_of(tmp_path, ARM, robot)
    with running(engine, scene) as backend:
        for step, steps in ((0, 0), (0, 120)):
            advance(backend, step, steps, *[MOVING] * min(steps, 1))
            now = backend.observe(steps, contacts=False)
            poses = link_poses(scene.model, {name: state.position for name, state in now.joints.items()})
            assert [
                link for link in LINKS if not same(backend.link_pose(link), geometry.compose(now.pose, poses[link]))
            ] == []
        assert backend.link_pose("base") == now.pose


@pytest.mark.parametrize("link", LINKS)
def test_a_twist_is_how_fast_the_frame_of_a_link_moves(engine: str, link: str, tmp_path: Path) -> None:
    rate = 2400
    with running(engine, scene_of(tmp_path, ARM, at(z=9, yaw=0.4), rate=rate)) as backend:
        push(backend, (0.5, 0, 0), (0.3, 0.5, 2))
        advance(backend, 0, 200, MOVING)
        before = backend.link_pose(link)
        advance(backend, 200, 1)
        twist, after = backend.link_twist(link), backend.link_pose(link)
    moved = (np.array(after.position_xyz) - before.position_xyz) * rate
    turned = geometry.multiply(after.orientation_xyzw, geometry.conjugate(before.orientation_xyzw))
    assert twist.linear_xyz == pytest.approx(moved, abs=0.005)
    assert twist.angular_xyz == pytest.approx([2 * rate * part for part in turned[:3]], abs=0.005)
    assert math.hypot(*twist.linear_xyz) > 0.1


def test_a_body_of_the_world_is_where_it_has_come_to(engine: str, tmp_path: Path) -> None:
    place = Placement(x=1, y=2, z=3, roll=0.1, pitch=0.2, yaw=0.3)
    bodies = [
        Body(name=name, sphere=Sphere(radius=0.1), mass=mass, pose=place.model_copy(update={"y": y}))
        for name, mass, y in (("falls", 2.0, 2.0), ("stays", None, 4.0), ("falls, too", 1.0, 6.0))
    ]
    with running(engine, scene_of(tmp_path, ARM, at(z=9), World(objects=tuple(bodies)))) as backend:
        advance(backend, 0, 120)
        poses = {body.name: backend.body_pose(body.name) for body in bodies}
    for body in bodies:
        fallen = 9.80665 / 2 * 0.5 * (0.5 + 1 / 240) if body.mass else 0.0
        assert poses[body.name].position_xyz == pytest.approx((1, body.pose.y, 3 - fallen), abs=1e-3)
        assert poses[body.name].orientation_xyzw == pytest.approx(place.orientation_xyzw, abs=1e-9)
