"""/tf and /tf_static, against the arithmetic of single poses."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_model import Joint, Link, RobotModel
from tests.recording.export.logs import read
from tests.recording.export.runs import MOMENTS, TIME, appearing, run, sensing_run

MAP, BASE = "map", "base_footprint"


def placed(run: RecordedRun, moment: int, frame: str) -> Pose:
    """A frame in the map, as who follows the tree finds it."""
    log = read(run)
    told = [*log["/tf_static"][0].message.transforms, *log["/tf"][moment].message.transforms]
    parents = {transform.child_frame_id: transform for transform in told}
    assert len(parents) == len(told), "a frame has two parents"
    pose = Pose()
    while frame != MAP:
        pose = geometry.compose(_pose(parents[frame].transform), pose)
        frame = parents[frame].header.frame_id
    return pose


def _pose(transform: Any) -> Pose:
    moved, turned = transform.translation, transform.rotation
    return Pose((moved.x, moved.y, moved.z), (turned.x, turned.y, turned.z, turned.w))


def assert_near(one: Pose, other: Pose) -> None:
    assert one.position_xyz == pytest.approx(other.position_xyz, abs=1e-9)
    sign = 1 if sum(a * b for a, b in zip(one.orientation_xyzw, other.orientation_xyzw, strict=True)) > 0 else -1
    assert one.orientation_xyzw == pytest.approx([sign * part for part in other.orientation_xyzw], abs=1e-9)


@pytest.mark.parametrize("made", [run(), sensing_run()], ids=["truth", "wheels"])
@pytest.mark.parametrize("moment", [0, 7, MOMENTS - 1])
def test_the_map_has_the_truth_whatever_wheels_say(made: RecordedRun, moment: int) -> None:
    base = Pose((TIME[moment], 0.25, 0.0), geometry.quaternion_from_rpy(0.0, 0.0, 2 * TIME[moment]))
    assert_near(placed(made, moment, BASE), base)
    links = link_poses(made.scene.model, {"wheel_left_joint": -3 * TIME[moment]})
    for name in ("wheel_left_link", "wheel_right_link", "base_scan"):
        assert_near(placed(made, moment, name), geometry.compose(base, links[name]))


def test_wheels_place_the_base_in_odom_and_their_error_moves_odom_in_the_map() -> None:
    first, *_, last = read(sensing_run())["/tf"]
    odom = {transform.child_frame_id: transform for transform in last.message.transforms}["odom"]
    assert odom.header.frame_id == MAP
    base = {transform.child_frame_id: transform for transform in last.message.transforms}[BASE]
    assert base.transform.translation.x == pytest.approx(1.1 * 0.4)
    assert [transform.header.stamp.sec for transform in first.message.transforms] == [0] * 5


def test_bodies_and_sensors_have_frames_of_their_own() -> None:
    made = sensing_run()
    assert_near(placed(made, 9, "ball"), Pose((1.0, TIME[9], 0.1)))
    assert_near(placed(made, 9, "wall"), Pose((2.0, 0.0, 0.25)))
    lidar = geometry.compose(placed(made, 9, "base_scan"), Pose((0.0, 0.0, 0.02)))
    assert_near(placed(made, 9, "front"), lidar)


def test_a_body_has_a_frame_once_it_has_appeared() -> None:
    log = read(appearing(TIME[5]))
    told = [{transform.child_frame_id for transform in entry.message.transforms} for entry in log["/tf"]]
    assert [{"ball", "wall"} & frames for frames in told] == [set()] * 5 + [{"ball", "wall"}] * (MOMENTS - 5)
    assert all(BASE in frames for frames in told)
    assert not {"ball", "wall"} & {each.child_frame_id for each in log["/tf_static"][0].message.transforms}
    assert_near(placed(appearing(TIME[5]), 5, "ball"), Pose((1.0, TIME[5], 0.1)))


def test_links_of_joints_in_series_with_anchors_have_one_frame_each() -> None:
    made = run()
    trace = replace(made.trace, joint_names=("swing", "bend"))
    links = tuple(Link(name, 1.0) for name in (BASE, "hand", "tool"))
    joints = (
        Joint("swing", "revolute", BASE, "hand", Pose((0.1, 0, 0.2)), (0, 1, 0), anchor_xyz=(0.1, 0, -0.3)),
        Joint("bend", "revolute", BASE, "hand", Pose((0.1, 0, 0.2)), (1, 0, 0), anchor_xyz=(0, 0.2, 0)),
        Joint("weld", "fixed", "hand", "tool", Pose((0, 0, 0.3), geometry.quaternion_from_rpy(0, 1, 0)), (0, 0, 1)),
    )
    model = RobotModel("arm", "arm.urdf", links, joints, "")
    arm = replace(made, scene=replace(made.scene, model=model), trace=trace)
    poses = link_poses(model, dict(zip(trace.joint_names, trace.joint_position[7].tolist(), strict=True)))
    base = Pose((TIME[7], 0.25, 0.0), geometry.quaternion_from_rpy(0.0, 0.0, 2 * TIME[7]))
    for name in ("hand", "tool"):
        assert_near(placed(arm, 7, name), geometry.compose(base, poses[name]))
