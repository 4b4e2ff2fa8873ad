"""Whoever follows the joints of a replay, or the transforms of ROS 2, finds each link where the engine had it."""

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
from sim_action.ros.messages import Message
from sim_action.ros.ros2.topics import Channels, channels
from sim_action.state.command import JointTargets
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.world.scene import Scene
from tests.integration.engines import advance, on_every_engine, running, scene_of_file
from tests.mesh_files import HALF, stl
from tests.ros.ros2.scenes import first_message
from tests.ros.ros2.scenes import scene as ros_scene

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


def placed(found: Channels, seen: Observation, frame: str) -> Pose:
    """Return the pose of a frame in the root of the tree, as a listener finds it."""
    told = [each for topic in ("/tf", "/tf_static") for each in first_message(found, topic, seen)["transforms"]]
    parents = {each["child_frame_id"]: each for each in told}
    assert len(parents) == len(told), "a frame has two parents"
    pose = Pose()
    while frame in parents:
        pose = geometry.compose(_of_transform(parents[frame]["transform"]), pose)
        frame = parents[frame]["header"]["frame_id"]
    return pose


def _of_transform(transform: Message) -> Pose:
    x, y, z = transform["translation"].values()
    qx, qy, qz, qw = transform["rotation"].values()
    return Pose((x, y, z), (qx, qy, qz, qw))


HUSKY_WHEELS = ("front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel")
ROBOTS = {
    "turtlebot3_burger": ("", {"wheel_left_joint": 4.0, "wheel_right_joint": -2.0}),
    "husky_a200": ("", dict.fromkeys(HUSKY_WHEELS, 3.0)),
    "ur5e_gripper": (", base: fixed", {"shoulder_lift_joint": -0.5, "elbow_joint": 0.8, "wrist_1_joint": -0.4}),
}


@on_every_engine
@pytest.mark.parametrize("model", ROBOTS)
def test_links_are_where_the_engine_has_them(engine: str, model: str, tmp_path: Path) -> None:
    robot, speeds = ROBOTS[model]
    there = ros_scene(tmp_path, model, robot=robot)
    found = channels(there, {}, 240.0)
    with running(engine, there) as backend:
        advance(backend, 0, 120, JointTargets(velocity=speeds))
        seen = backend.observe(120, contacts=False)
        base = seen.pose if there.bolted else Pose()
        assert max(abs(state.position) for state in seen.joints.values()) > 0.1
        for link in there.model.links:
            theirs = backend.link_pose(link.name)
            apart = geometry.compose(geometry.inverse(theirs), geometry.compose(base, placed(found, seen, link.name)))
            assert apart.position_xyz == pytest.approx((0, 0, 0), abs=1e-6), link.name
            assert apart.orientation_xyzw[:3] == pytest.approx((0, 0, 0), abs=1e-6), link.name
