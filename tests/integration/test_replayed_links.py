"""Whoever follows a replay's joints finds each link where the engine had it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.recording.replay.build import replay_of
from sim_action.recording.replay.replay_data import Replay
from sim_action.recording.replay.scene_data import JointMotion, MeshShape, PoseNumbers
from sim_action.state.command import JointTargets
from sim_action.state.trace import Trace
from sim_action.world.scene import Scene
from tests.integration.engines import advance, on_every_engine, running, scene_of_file
from tests.mesh_files import HALF, stl

ARM = """\
<robot name="arm">
  <link name="base">{mass}<collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
  <link name="upper">{mass}<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <link name="hand">{mass}<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <link name="tool">{mass}<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 1"/>
    <origin xyz="0 0.1 0.5" rpy="0.3 0 0.5"/><limit lower="-2" upper="2" effort="100" velocity="10"/></joint>
  <joint name="reach" type="prismatic"><parent link="upper"/><child link="hand"/><axis xyz="1 0 0"/>
    <origin xyz="0.5 0 0" rpy="0 0.2 0"/><limit lower="-1" upper="1" effort="100" velocity="10"/></joint>
  <joint name="weld" type="fixed"><parent link="hand"/><child link="tool"/><origin xyz="0 0 0.3" rpy="0 0 1"/></joint>
</robot>
""".format(mass='<inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>')

NATIVE = """\
<mujoco model="native">
  <asset><mesh name="box" file="box.stl"/><material name="red" rgba="1 0 0 1"/></asset>
  <worldbody>
    <body name="base">
      <geom type="box" size="0.2 0.2 0.2" rgba="0 0 1 1"/>
      <body name="shoulder" pos="0 0 0.5" euler="10 20 30">
        <joint name="swing" axis="0 1 0" pos="0.1 0 -0.2" range="-90 90"/>
        <joint name="lift" type="slide" axis="0 0 1" range="-1 1"/>
        <joint name="twist" axis="1 0 0" pos="0 0.3 0" range="-90 90"/>
        <geom type="mesh" mesh="box" group="2" contype="0" conaffinity="0" material="red" pos="0.4 0 0" mass="1"/>
        <geom type="sphere" size="0.1" group="3"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


LINKS = ("base", "shoulder")


def scene(folder: Path, name: str, text: str) -> Scene:
    (folder / "box.stl").write_bytes(stl())
    return scene_of_file(folder, name, text, base="fixed")


def last_poses(replay: Replay) -> dict[str, Pose]:
    """Link name -> its pose in the world at the last moment; of several of one name, that of the last."""
    frames = replay.frames
    base = [float(column.decoded(frames.count)[-1]) for column in frames.base]
    joints = [float(column.decoded(frames.count)[-1]) for column in frames.joints]
    poses = [_pose((base[0], base[1], base[2], base[3], base[4], base[5], base[6]))]
    for link in replay.scene.links[1:]:
        assert link.parent is not None
        at = geometry.compose(poses[link.parent], _pose(link.origin))
        poses.append(geometry.compose(at, _moved(link.joint, joints)) if link.joint else at)
    return {link.name: pose for link, pose in zip(replay.scene.links, poses, strict=True)}


def _pose(numbers: PoseNumbers) -> Pose:
    return Pose(numbers[:3], numbers[3:])


def _moved(joint: JointMotion, positions: list[float]) -> Pose:
    position = joint.multiplier * positions[joint.column] + joint.offset
    x, y, z = joint.axis
    if joint.type == "prismatic":
        return Pose((x * position, y * position, z * position))
    sine = math.sin(position / 2)
    return Pose((0.0, 0.0, 0.0), (x * sine, y * sine, z * sine, math.cos(position / 2)))


def assert_links_are_where_they_were(engine: str, there: Scene, targets: dict[str, float]) -> Replay:
    with running(engine, there) as backend:
        trace: Trace = advance(backend, 0, 480, JointTargets(position=targets))
        replay = replay_of(there, trace)
        found = last_poses(replay)
        assert trace.joint_position[-1] == pytest.approx(list(targets.values()), abs=0.2)
        for link in there.model.links:
            pose = backend.link_pose(link.name)
            assert found[link.name].position_xyz == pytest.approx(pose.position_xyz, abs=2e-3), link.name
            alike = abs(np.dot(found[link.name].orientation_xyzw, pose.orientation_xyzw))
            assert alike == pytest.approx(1.0, abs=1e-5), link.name
    return replay


@on_every_engine
def test_links_of_urdf_are_where_they_were(engine: str, tmp_path: Path) -> None:
    assert_links_are_where_they_were(engine, scene(tmp_path, "arm.urdf", ARM), {"turn": 0.7, "reach": 0.4})


def test_links_of_mjcf_are_where_they_were_and_look_as_they_are_drawn(tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="MJCF is read by MuJoCo, which is not installed")
    there = scene(tmp_path, "native.xml", NATIVE)
    replay = assert_links_are_where_they_were("mujoco", there, {"swing": 0.6, "lift": 0.3, "twist": -0.5})
    base, shoulder = (next(link for link in replay.scene.links[::-1] if link.name == name) for name in LINKS)
    assert [(shape.kind, shape.color) for shape in base.shapes] == [("box", (0.0, 0.0, 1.0))]
    (shape,) = shoulder.shapes
    assert isinstance(shape, MeshShape)
    assert shape.color == (1.0, 0.0, 0.0)
    mesh = replay.scene.meshes[shape.mesh]
    frame = _pose(shape.pose)
    own = [(x * mesh.scale, y * mesh.scale, z * mesh.scale) for x, y, z in mesh.decoded()[0].tolist()]
    points = np.array([geometry.compose(frame, Pose(point)).position_xyz for point in own])
    assert points.min(axis=0) == pytest.approx([0.4 - HALF[0], -HALF[1], -HALF[2]], abs=2e-3)
    assert points.max(axis=0) == pytest.approx([0.4 + HALF[0], HALF[1], HALF[2]], abs=2e-3)
