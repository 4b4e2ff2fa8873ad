"""The frames of a robot: one tree, with names that do not clash."""

from __future__ import annotations

from pathlib import Path

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.ros.ros2.messages import OPTICAL
from sim_action.ros.ros2.robot_frames import RobotFrames
from tests.ros.ros2.scenes import SENSORS, resting, scene

ROBOT = """
<robot name="r">
  <link name="odom">
    <inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <collision><geometry><sphere radius="1"/></geometry></collision>
  </link>
  <link name="eye_optical_frame"/>
  <joint name="j" type="fixed"><parent link="odom"/><child link="eye_optical_frame"/></joint>
</robot>
"""


def test_sensors_without_a_pose_measure_in_the_frame_of_their_link(tmp_path: Path) -> None:
    frames = RobotFrames.of(scene(tmp_path, more=SENSORS))

    assert frames.sensors["lidar"] == "base_scan"
    assert frames.sensors["wheels"] == "base_footprint"
    assert frames.sensors["eye"] == "eye_optical_frame"
    assert frames.mounted == (
        ("base_footprint", "eye_optical_frame", geometry.compose(Pose((0.1, 0.0, 0.0)), OPTICAL)),
    )


def test_a_sensor_with_a_pose_has_a_frame_of_its_own(tmp_path: Path) -> None:
    more = "sensors: [{lidar: {}, name: front lidar, link: base_scan, pose: {z: 0.2 m}}]\n"
    frames = RobotFrames.of(scene(tmp_path, more=more))

    assert frames.sensors["front lidar"] == "front_lidar_frame"
    assert frames.mounted == (("base_scan", "front_lidar_frame", Pose((0.0, 0.0, 0.2))),)


def test_names_of_links_are_not_used_twice(tmp_path: Path) -> None:
    (tmp_path / "r.urdf").write_text(ROBOT, encoding="utf-8")
    frames = RobotFrames.of(scene(tmp_path, "r.urdf", "sensors: [{camera: {}, name: eye}]\n"))

    assert (frames.odom, frames.base) == ("odom_", "odom")
    assert frames.sensors["eye"] == "eye_optical_frame_"


def test_every_link_has_one_parent(tmp_path: Path) -> None:
    for model in ("turtlebot3_burger", "husky_a200", "ur5e_gripper"):
        there = scene(tmp_path, model)
        frames = RobotFrames.of(there)
        moving = list(frames.of_joints(resting(there).joints))
        children = [child for _, child, _ in (*frames.fixed, *moving)]

        assert sorted(children) == sorted(link.name for link in there.model.links if link.name != frames.base)
