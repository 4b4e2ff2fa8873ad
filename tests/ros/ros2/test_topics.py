"""The topics of a robot: their names, types, quality of service, rates and content."""

from __future__ import annotations

from itertools import chain, pairwise
from pathlib import Path

import pytest

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist, quaternion_from_rpy
from sim_action.ros.messages import OPTICAL
from sim_action.ros.ros2.topics import RobotFrames, channels, states_schedule, topic_problems, topics_of
from sim_action.state.readings import LidarScan
from tests.ros.ros2.scenes import ARM, SENSORS, first_message, moment, publisher, resting, scene

RATE = 100.0

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


def test_a_robot_has_the_topics_types_and_qualities_of_ros_gz_bridge(tmp_path: Path) -> None:
    found = channels(scene(tmp_path, more=SENSORS), {}, RATE)
    usual, latched = ("reliable", "volatile", 10), ("reliable", "transient_local", 1)
    assert {each.topic: (each.type, tuple(each.qos.as_dict().values())) for each in found.publishers} == {
        "/joint_states": ("sensor_msgs/msg/JointState", usual),
        "/odom": ("nav_msgs/msg/Odometry", usual),
        "/tf": ("tf2_msgs/msg/TFMessage", ("reliable", "volatile", 100)),
        "/tf_static": ("tf2_msgs/msg/TFMessage", latched),
        "/robot_description": ("std_msgs/msg/String", latched),
        "/scan": ("sensor_msgs/msg/LaserScan", usual),
        "/imu": ("sensor_msgs/msg/Imu", usual),
        "/eye/image_raw": ("sensor_msgs/msg/Image", usual),
        "/eye/camera_info": ("sensor_msgs/msg/CameraInfo", usual),
        "/eye/depth/image_raw": ("sensor_msgs/msg/Image", usual),
        "/eye/depth/camera_info": ("sensor_msgs/msg/CameraInfo", usual),
        "/contact": ("std_msgs/msg/Bool", usual),
    }
    (drive,) = found.subscriptions
    assert (drive.topic, drive.types) == ("/cmd_vel", ("geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"))


def test_an_arm_that_is_fixed_has_no_odometry_and_no_twist(tmp_path: Path) -> None:
    there = scene(tmp_path, ARM, robot=", base: fixed")
    assert set(topics_of(there, {})).isdisjoint({"odom", "cmd_vel"})
    tf = first_message(channels(there, {}, RATE), "/tf", resting(there))
    assert {each["header"]["frame_id"] for each in tf["transforms"]}.isdisjoint({"odom", "world"})


def test_stated_topics_take_the_place_of_usual_ones(tmp_path: Path) -> None:
    there = scene(tmp_path, more=SENSORS)
    found = channels(there, {"cmd_vel": "base/cmd_vel", "eye": "/front/image", "lidar": "/scan_raw"}, RATE)
    assert found.subscriptions[0].topic == "/base/cmd_vel"
    assert {"/scan_raw", "/front/image", "/front/camera_info"} <= {each.topic for each in found.publishers}


def test_topics_and_frames_of_a_robot_begin_with_its_namespace(tmp_path: Path) -> None:
    there = scene(tmp_path, more=SENSORS)
    found = channels(there, {"cmd_vel": "drive", "imu": "/imu2"}, RATE, space="/a/b")
    assert found.subscriptions[0].topic == "/a/b/drive"
    topics = {each.topic for each in found.publishers}
    assert {"/tf", "/tf_static", "/imu2", "/a/b/scan", "/a/b/eye/camera_info", "/a/b/robot_description"} < topics
    assert all(topic.startswith("/a/b/") for topic in topics - {"/tf", "/tf_static", "/imu2"})
    seen = resting(there)
    messages = (first_message(found, topic, seen) for topic in ("/tf", "/tf_static"))
    transforms = chain.from_iterable(message["transforms"] for message in messages)
    frames = [(each["header"]["frame_id"], each["child_frame_id"]) for each in transforms]
    assert {("a/b/odom", "a/b/base_footprint"), ("a/b/base_footprint", "a/b/eye_optical_frame")} < set(frames)
    assert all(name.startswith("a/b/") for pair in frames for name in pair)
    assert first_message(found, "/a/b/scan", seen)["header"]["frame_id"] == "a/b/base_scan"
    odometry = first_message(found, "/a/b/odom", seen)
    assert (odometry["header"]["frame_id"], odometry["child_frame_id"]) == ("a/b/odom", "a/b/base_footprint")


def test_unknown_keys_and_topics_used_twice_are_named(tmp_path: Path) -> None:
    there = scene(tmp_path, more=SENSORS)
    (path, unknown), (_, twice) = topic_problems(there, {"lidr": "/s", "imu": "/scan"})
    assert path == ("lidr",)
    assert "the robot has no 'lidr'; did you mean 'lidar'?" in unknown
    assert twice == "'/scan' is already the topic of 'lidar'"


@pytest.mark.parametrize("topic", ["/clock", "tf", "/robot_description", "/rosout"])
def test_topics_that_every_robot_has_are_not_stated(tmp_path: Path, topic: str) -> None:
    (problem,) = topic_problems(scene(tmp_path), {"cmd_vel": topic})
    assert problem == (("cmd_vel",), f"'/{topic.strip('/')}' is a topic that every robot has; choose another one")


@pytest.mark.parametrize(
    ("stated", "key", "topic", "camera"),
    [
        ({"lidar": "/eye/camera_info"}, "lidar", "/eye/camera_info", "eye"),
        ({"lidar": "/front/depth/image_raw", "eye": "/front/image"}, "lidar", "/front/depth/image_raw", "eye"),
        ({"right": "/left/other"}, "right", "/left/camera_info", "left"),
    ],
)
def test_topics_beside_the_image_of_a_camera_are_taken(
    tmp_path: Path, stated: dict[str, str], key: str, topic: str, camera: str
) -> None:
    one = "  - {{camera: {{width: 4, height: 2}}, name: {}, rate: 10 Hz}}\n"
    there = scene(tmp_path, more=SENSORS if camera == "eye" else f"sensors:\n{one.format('left')}{one.format('right')}")
    ((path, message),) = topic_problems(there, stated)
    assert (path, message) == ((key,), f"'{topic}' is already a topic of the camera '{camera}'")


@pytest.mark.parametrize(
    ("ticks", "interval"), [(100, 2), (120, 3), (200, 4), (240, 5), (1000, 20), (50, 1), (30, 1), (60, 2), (50.5, 2)]
)
def test_states_are_evenly_spaced_at_most_50_times_per_second(ticks: float, interval: int) -> None:
    schedule = states_schedule(ticks)
    due = [tick for tick in range(2001) if schedule.is_due(tick)]
    assert {after - before for before, after in pairwise(due)} == {interval}


def test_odometry_is_in_the_frame_of_the_base(tmp_path: Path) -> None:
    found = channels(scene(tmp_path), {}, RATE)
    turned = Pose((1.0, 2.0, 0.0), quaternion_from_rpy(0.0, 0.0, 1.5707963267948966))
    odometry = first_message(found, "/odom", moment(0.02, turned, Twist((0.0, 0.3, 0.0), (0.0, 0.0, 0.4))))
    assert odometry["header"] == {"stamp": {"sec": 0, "nanosec": 20_000_000}, "frame_id": "odom"}
    assert odometry["child_frame_id"] == "base_footprint"
    assert odometry["pose"]["pose"]["position"] == {"x": 1.0, "y": 2.0, "z": 0.0}
    assert odometry["twist"]["twist"]["linear"] == pytest.approx({"x": 0.3, "y": 0.0, "z": 0.0})
    assert odometry["twist"]["twist"]["angular"] == {"x": 0.0, "y": 0.0, "z": 0.4}
    assert publisher(found, "/odom").message(1, moment(0.03)) is None


def test_a_sensor_of_odometry_takes_the_place_of_the_truth_also_in_tf(tmp_path: Path) -> None:
    there = scene(tmp_path, more=SENSORS)
    found, seen = channels(there, {}, RATE), resting(there, pose=Pose((5.0, 0.0, 0.0)))
    assert first_message(found, "/odom", seen)["pose"]["pose"]["position"]["x"] == 1.0
    base = first_message(found, "/tf", seen)["transforms"][0]
    assert (base["header"]["frame_id"], base["child_frame_id"]) == ("odom", "base_footprint")
    assert base["transform"]["translation"]["x"] == 1.0
    # The reading is not published again; links are.
    again = publisher(found, "/tf").message(2, seen)
    assert again is not None
    assert {each["child_frame_id"] for each in again["transforms"]} == {"wheel_left_link", "wheel_right_link"}


def test_each_reading_is_published_once_with_its_own_time(tmp_path: Path) -> None:
    there = scene(tmp_path, more=SENSORS)
    found, seen = channels(there, {}, RATE), resting(there, 0.2)
    scan = publisher(found, "/scan")
    message = scan.message(20, seen)
    assert message is not None
    assert message["header"] == {"stamp": {"sec": 0, "nanosec": 200_000_000}, "frame_id": "base_scan"}
    reading = seen.sensors["lidar"]
    assert isinstance(reading, LidarScan)
    assert message["ranges"].tolist() == reading.ranges.tolist()
    assert (message["angle_min"], message["angle_max"], message["scan_time"]) == (-1.0, 1.0, 0.2)
    assert scan.message(21, seen) is None


def test_joint_states_are_those_of_all_joints_that_move_and_descriptions_come_once(tmp_path: Path) -> None:
    there = scene(tmp_path)
    seen = resting(there, joints={"wheel_left_joint": 1.0, "wheel_right_joint": 2.0})
    message = first_message(channels(there, {}, RATE), "/joint_states", seen)
    assert message["name"] == ["wheel_left_joint", "wheel_right_joint"]
    found = channels(there, {}, RATE)
    assert "<robot" in first_message(found, "/robot_description", seen)["data"]
    for topic in ("/robot_description", "/tf_static"):
        assert publisher(found, topic).message(1, seen) is None
    assert message["position"].tolist() == [1.0, 2.0]


def test_a_robot_state_publisher_keeps_the_frames_of_links(tmp_path: Path) -> None:
    there = scene(tmp_path, more=SENSORS)
    found, seen = channels(there, {}, RATE, described=True), resting(there)
    assert [each["child_frame_id"] for each in first_message(found, "/tf", seen)["transforms"]] == ["base_footprint"]
    static = first_message(found, "/tf_static", seen)["transforms"]
    assert [each["child_frame_id"] for each in static] == ["eye_optical_frame"]
    assert "/robot_description" not in {each.topic for each in found.publishers}


def test_a_sensor_measures_in_the_frame_of_its_link_or_in_a_frame_of_its_own(tmp_path: Path) -> None:
    frames = RobotFrames.of(scene(tmp_path, more=SENSORS))
    own = ("base_footprint", "eye_optical_frame", geometry.compose(Pose((0.1, 0.0, 0.0)), OPTICAL))
    assert frames.mounted == (own,)
    names = {"lidar": "base_scan", "wheels": "base_footprint", "eye": "eye_optical_frame"}
    assert {name: frames.sensors[name] for name in names} == names
    more = "sensors: [{lidar: {}, name: front lidar, link: base_scan, pose: {z: 0.2 m}}]\n"
    frames = RobotFrames.of(scene(tmp_path, more=more))
    assert frames.sensors["front lidar"] == "front_lidar_frame"
    assert frames.mounted == (("base_scan", "front_lidar_frame", Pose((0.0, 0.0, 0.2))),)
    # Names of links are not used twice.
    (tmp_path / "r.urdf").write_text(ROBOT, encoding="utf-8")
    frames = RobotFrames.of(scene(tmp_path, "r.urdf", "sensors: [{camera: {}, name: eye}]\n"))
    assert (frames.odom, frames.base, frames.sensors["eye"]) == ("odom_", "odom", "eye_optical_frame_")


def test_every_link_has_one_parent(tmp_path: Path) -> None:
    for model in ("turtlebot3_burger", "husky_a200", "ur5e_gripper"):
        there = scene(tmp_path, model)
        frames = RobotFrames.of(there)
        moving = list(frames.links.at({name: joint.position for name, joint in resting(there).joints.items()}))
        children = [child for _, child, _ in (*frames.links.fixed, *moving)]
        assert sorted(children) == sorted(link.name for link in there.model.links if link.name != frames.base)
