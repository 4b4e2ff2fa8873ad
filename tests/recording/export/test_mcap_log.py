"""The log of a run, read back by MCAP's own reader and decoder, and by rosbags."""

from __future__ import annotations

import io
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.core.workspace import Workspace
from sim_action.recording.export.mcap_log import McapLog
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_model import Joint, Link, RobotModel
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model
from sim_action.state.command import LinkWrench
from sim_action.world import Body
from sim_action.world.shapes import Cylinder, Ramp
from tests.outcomes import like
from tests.recording.export.logs import read
from tests.recording.export.runs import MOMENTS, TIME, appearing, run, sensing_run

STAMPS = [round(time * 1e9) for time in TIME]


def test_each_topic_has_its_type_and_its_times() -> None:
    log = read(sensing_run())
    told = {topic: (some[0].schema, len(some)) for topic, some in log.items()}
    assert told == {
        "/robot_description": ("std_msgs/msg/String", 1),
        "/tf_static": ("tf2_msgs/msg/TFMessage", 1),
        "/tf": ("tf2_msgs/msg/TFMessage", MOMENTS),
        "/world": ("visualization_msgs/msg/MarkerArray", 1),
        "/clock": ("rosgraph_msgs/msg/Clock", MOMENTS),
        "/joint_states": ("sensor_msgs/msg/JointState", MOMENTS),
        "/cmd_vel": ("geometry_msgs/msg/Twist", 2),
        "/odom": ("nav_msgs/msg/Odometry", 5),
        "/ground_truth/odom": ("nav_msgs/msg/Odometry", MOMENTS),
        "/scan": ("sensor_msgs/msg/LaserScan", 5),
        "/imu": ("sensor_msgs/msg/Imu", 5),
        "/contacts": ("visualization_msgs/msg/MarkerArray", 1),
    }
    for topic in ("/tf", "/clock", "/joint_states", "/ground_truth/odom"):
        assert [some.time for some in log[topic]] == STAMPS
    assert [some.time for some in log["/cmd_vel"]] == [0, 100_000_000]


def test_messages_lie_in_the_order_of_their_times() -> None:
    file = io.BytesIO()
    McapLog.write(sensing_run(), file)
    file.seek(0)
    times = [message.log_time for _, _, message in make_reader(file).iter_messages(log_time_order=False)]
    assert all(one <= other for one, other in pairwise(times))


def test_what_the_robot_did_is_in_its_messages() -> None:
    log = read(run())
    state = log["/joint_states"][10].message
    assert list(state.name) == ["wheel_left_joint", "wheel_right_joint"]
    assert list(state.position) == pytest.approx([-1.0, 0.0])
    assert list(state.velocity) == [-3.0, 0.0]
    clock = log["/clock"][10].message.clock
    assert (clock.sec, clock.nanosec) == (0, 333_333_333)
    twist = log["/cmd_vel"][1].message
    assert (twist.linear.x, twist.angular.z) == (0.5, -2.0)


def test_odometry_with_and_without_wheels() -> None:
    # Without wheels that are counted odometry is the truth in the frame of the base.
    log = read(run())
    assert "/ground_truth/odom" not in log
    odometry = log["/odom"][10].message
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_footprint")
    assert odometry.pose.pose.position.x == pytest.approx(TIME[10])
    # It moves along the world's x, and has turned by 2 rad/s to the left.
    turned = 2 * TIME[10]
    assert odometry.twist.twist.linear.x == pytest.approx(math.cos(turned))
    assert odometry.twist.twist.linear.y == pytest.approx(-math.sin(turned))
    assert odometry.twist.twist.angular.z == pytest.approx(2.0)
    assert list(odometry.pose.covariance) == [0.0] * 36
    # Where wheels are counted odometry is what they tell.
    log = read(sensing_run())
    assert log["/odom"][-1].message.pose.pose.position.x == pytest.approx(0.44)
    assert log["/ground_truth/odom"][12].message.pose.pose.position.x == pytest.approx(0.4)


def test_sensors_tell_in_their_own_frames() -> None:
    log = read(sensing_run())
    scan = log["/scan"][0].message
    assert scan.header.frame_id == "front"
    assert list(scan.ranges) == [1.0, math.inf, -math.inf, 2.5]
    assert scan.angle_min == pytest.approx(-math.pi)
    assert scan.angle_increment == pytest.approx(math.pi / 2)
    assert scan.angle_max == pytest.approx(math.pi / 2)
    assert (scan.range_min, scan.range_max, scan.scan_time) == pytest.approx((0.1, 3.5, 0.1))
    imu = log["/imu"][-1].message
    assert imu.header.frame_id == "imu"
    assert imu.linear_acceleration.z == pytest.approx(9.80665)
    assert (imu.header.stamp.sec, imu.header.stamp.nanosec) == (0, 400_000_000)


def test_several_sensors_of_a_kind_have_topics_by_their_names() -> None:
    made = sensing_run()
    lidar = made.sensors[0]
    twins = (replace(lidar, name="left side"), replace(lidar, name="1"))
    records = {mounted.name: made.trace.sensors["front"] for mounted in twins}
    log = read(replace(made, sensors=twins, trace=replace(made.trace, sensors=records)))
    assert {"/left_side/scan", "/sensor_1/scan"} <= set(log)
    assert log["/left_side/scan"][0].message.header.frame_id == "left side"


def test_drawn_topics() -> None:
    # What is touched is marked where it was last touched.
    (told,) = read(run())["/contacts"]
    assert told.time == STAMPS[10]
    ball, wall = told.message.markers
    assert [marker.ns for marker in (ball, wall)] == ["base_footprint / ball", "base_footprint / wall"]
    assert (len(ball.points), len(wall.points)) == (1, 2), "at 0.31 s, and no more at 0.305 s"
    assert (wall.points[0].x, wall.points[0].y, wall.points[0].z) == (1.0, 0.25, 0.1)
    assert (wall.header.frame_id, wall.type, wall.action, wall.lifetime.sec) == ("map", 7, 0, 1)
    # Who touches nothing in an empty world has no markers.
    made = run()
    scene = replace(made.scene, world=like(made.scene.world, objects=()))
    log = read(replace(made, scene=scene, trace=replace(made.trace, contacts=(), bodies={})))
    assert {"/contacts", "/world"}.isdisjoint(log)
    # The world is there to be seen.
    (told,) = read(run())["/world"]
    wall, ball = told.message.markers
    assert (wall.header.frame_id, wall.type, wall.scale.y) == ("wall", 1, 2.0)
    assert (ball.header.frame_id, ball.type, ball.scale.z) == ("ball", 2, 0.2)
    assert wall.frame_locked
    assert wall.lifetime.sec == 0


def test_a_cylinder_and_a_ramp_are_there_to_be_seen() -> None:
    made = run()
    post = Body(name="post", cylinder=Cylinder(radius=0.25, height=2.0))
    ramp = Body(name="ramp", ramp=Ramp(length=2.0, width=1.0, height=0.5))
    scene = replace(made.scene, world=like(made.scene.world, objects=(post, ramp)))
    (told,) = read(replace(made, scene=scene, trace=replace(made.trace, contacts=(), bodies={})))["/world"]
    first, second = told.message.markers
    assert (first.header.frame_id, first.type) == ("post", 3)
    assert (first.scale.x, first.scale.y, first.scale.z) == (0.5, 0.5, 2.0)
    assert (second.header.frame_id, second.type, first.points) == ("ramp", 11, [])
    # A prism has two triangles and three rectangles.
    assert len(second.points) == 3 * (2 + 2 * 3)
    corners = [(point.x, point.y, point.z) for point in second.points]
    assert [max(axis) - min(axis) for axis in zip(*corners, strict=True)] == pytest.approx([2.0, 1.0, 0.5])


def test_the_description_of_the_robot_can_be_loaded(tmp_path: Path) -> None:
    made = run()
    (told,) = read(made)["/robot_description"]
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    weighed = told.message.data.replace("<visual>", f'<inertial><mass value="1"/>{inertia}</inertial><visual>')
    (tmp_path / "told.urdf").write_text(weighed)
    model = load_model(Robot(model="told.urdf"), Workspace(tmp_path, tmp_path))
    ours = made.scene.model
    assert [link.name for link in model.links] == [link.name for link in ours.links]
    assert [(joint.name, joint.type, joint.origin) for joint in model.joints] == [
        (joint.name, joint.type, joint.origin) for joint in ours.joints
    ]
    shapes = [(shape.kind, shape.upper_xyz) for link in model.links for shape in link.collisions]
    assert shapes == [(shape.kind, shape.upper_xyz) for link in ours.links for shape in link.collisions]


def test_a_held_wrench_in_the_frame_of_the_world_turns_in_that_of_its_link() -> None:
    """The burger turns by 2 rad/s."""
    link = "base_footprint"
    held = (LinkWrench(link, (1.0, 0.0, 0.0), (0.0, 0.5, 0.0)), LinkWrench(link, (0.0, 0.0, 3.0), frame="base"))
    nothing, own = (LinkWrench(link),), (LinkWrench(link, (0.0, 2.0, 0.0), frame=link),)
    log = read(replace(run(), wrenches=((0.1, held), (0.25, nothing), (0.3, own))))
    found = [(each.time / 1e9, each.message.wrench) for each in log["/wrench/base_footprint"]]
    assert [time for time, _ in found] == pytest.approx([*TIME[3:8], 0.25, 0.3])
    for time, wrench in found[:5]:
        force, torque = wrench.force, wrench.torque
        assert (force.x, force.y, force.z) == pytest.approx((math.cos(2 * time), -math.sin(2 * time), 3.0))
        assert (torque.x, torque.y) == pytest.approx((0.5 * math.sin(2 * time), 0.5 * math.cos(2 * time)))
    assert [(wrench.force.x, wrench.force.y) for _, wrench in found[5:]] == [(0.0, 0.0), (0.0, 2.0)]


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


def test_frames_of_wheels_bodies_and_sensors() -> None:
    # Wheels place the base in odom and their error moves odom in the map.
    first, *_, last = read(sensing_run())["/tf"]
    odom = {transform.child_frame_id: transform for transform in last.message.transforms}["odom"]
    assert odom.header.frame_id == MAP
    base = {transform.child_frame_id: transform for transform in last.message.transforms}[BASE]
    assert base.transform.translation.x == pytest.approx(1.1 * 0.4)
    assert [transform.header.stamp.sec for transform in first.message.transforms] == [0] * 5
    # Bodies and sensors have frames of their own.
    made = sensing_run()
    assert_near(placed(made, 9, "ball"), Pose((1.0, TIME[9], 0.1)))
    assert_near(placed(made, 9, "wall"), Pose((2.0, 0.0, 0.25)))
    lidar = geometry.compose(placed(made, 9, "base_scan"), Pose((0.0, 0.0, 0.02)))
    assert_near(placed(made, 9, "front"), lidar)
    # A body has a frame once it has appeared.
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


def test_channels_follow_the_profile_ros2_of_mcap_and_rosbags_reads_them(tmp_path: Path) -> None:
    """The profile demands CDR, `ros2msg` or `ros2idl`, and `offered_qos_profiles`, which rosbag2 reads in numbers."""
    path = tmp_path / "log.mcap"
    with path.open("wb") as file:
        McapLog.write(sensing_run(), file)
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert reader.get_header().profile == "ros2"
    assert summary is not None
    for channel in summary.channels.values():
        assert channel.message_encoding == "cdr"
        assert summary.schemas[channel.schema_id].encoding == "ros2msg"
        assert "offered_qos_profiles" in channel.metadata
    types, topics = get_typestore(Stores.ROS2_HUMBLE), set[str]()
    with Reader(path) as log:
        for connection, _, data in log.messages():
            types.deserialize_cdr(bytes(data), connection.msgtype)
            topics.add(connection.topic)
        assert len(topics) == 12
        offered = {connection.topic: connection.ext.offered_qos_profiles for connection in log.connections}  # type: ignore[union-attr]
    latched = {topic for topic, profiles in offered.items() if profiles[0].durability == QosDurability.TRANSIENT_LOCAL}
    assert latched == {"/tf_static", "/robot_description", "/world"}
    assert {profiles[0].reliability for profiles in offered.values()} == {QosReliability.RELIABLE}
    assert {len(profiles) for profiles in offered.values()} == {1}
