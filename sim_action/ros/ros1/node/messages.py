"""Conversions between our types and messages of ROS."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, Literal

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3
from rospy import Time
from sensor_msgs.msg import CameraInfo, Image, Imu, JointState, LaserScan, PointCloud2, PointField
from std_msgs.msg import Header

from sim_action.core import geometry
from sim_action.ros.robot_topics import diagonal, pinhole_of, seconds_and_nanoseconds
from sim_action.sensors.camera import Camera
from sim_action.state.observation import Observation
from sim_action.state.readings import CameraImage, ImuReading, LidarScan

if TYPE_CHECKING:
    from numpy.typing import NDArray

# As the Point Cloud Library lays out a point with a colour.
_OFFSETS: Final = (0, 4, 8, 16)
_POINT: Final = np.dtype(
    {"names": ["x", "y", "z", "rgb"], "formats": ["<f4", "<f4", "<f4", "<u4"], "offsets": _OFFSETS, "itemsize": 32}
)


def time_of(seconds: float) -> Time:
    """Return a sim time as ROS time, rounded to 1 ns."""
    return Time(*seconds_and_nanoseconds(seconds))


def header(seconds: float, frame: str) -> Header:
    """Return the header of a measurement at a sim time."""
    return Header(stamp=time_of(seconds), frame_id=frame)


def pose_message(pose: geometry.Pose) -> Pose:
    """Return a pose as message."""
    return Pose(Point(*pose.position_xyz), Quaternion(*pose.orientation_xyzw))


def twist_message(twist: geometry.Twist) -> Twist:
    """Return a twist as message."""
    return Twist(Vector3(*twist.linear_xyz), Vector3(*twist.angular_xyz))


def pose_of(message: Pose) -> geometry.Pose:
    """Return the pose of a message; an all-zero rotation counts as none."""
    at, turned = message.position, message.orientation
    rotation = (turned.x, turned.y, turned.z, turned.w)
    return geometry.Pose((at.x, at.y, at.z), rotation if any(rotation) else geometry.IDENTITY)


def twist_of(message: Twist) -> geometry.Twist:
    """Return the twist of a message."""
    linear, angular = message.linear, message.angular
    return geometry.Twist((linear.x, linear.y, linear.z), (angular.x, angular.y, angular.z))


def scan_message(reading: LidarScan, head: Header, period: float) -> LaserScan:
    """Return a scan as message; `period`: s between two scans."""
    return LaserScan(
        header=head,
        angle_min=reading.angle_min,
        angle_max=reading.angle_min + reading.angle_increment * (len(reading.ranges) - 1),
        angle_increment=reading.angle_increment,
        scan_time=period,
        range_min=reading.range_min,
        range_max=reading.range_max,
        ranges=reading.ranges.tolist(),
    )


def imu_message(reading: ImuReading, head: Header, deviation: float = 0.0) -> Imu:
    """Return a reading of an IMU as message; `deviation`: of its noise, for the covariances."""
    covariance = diagonal((deviation**2,) * 3)
    return Imu(
        header=head,
        orientation=Quaternion(*reading.orientation_xyzw),
        orientation_covariance=covariance,
        angular_velocity=Vector3(*reading.angular_velocity_xyz),
        angular_velocity_covariance=covariance,
        linear_acceleration=Vector3(*reading.linear_acceleration_xyz),
        linear_acceleration_covariance=covariance,
    )


def image_message(reading: CameraImage, head: Header, encoding: Literal["rgb8", "bgr8"] = "rgb8") -> Image:
    """Return the colours of a camera image as message."""
    height, width, colours = reading.rgb.shape
    data = (reading.rgb if encoding == "rgb8" else reading.rgb[:, :, ::-1]).tobytes()
    return Image(header=head, height=height, width=width, encoding=encoding, step=width * colours, data=data)


def depth_message(depth: NDArray[np.float32], head: Header) -> Image:
    """Return depths in m as message."""
    height, width = depth.shape
    return Image(header=head, height=height, width=width, encoding="32FC1", step=4 * width, data=depth.tobytes())


def points_message(depth: NDArray[np.float32], rgb: NDArray[np.uint8], camera: Camera, head: Header) -> PointCloud2:
    """Return the point that each pixel shows, in the optical frame, with its colour."""
    focal, cx, cy = pinhole_of(camera.width, camera.height, camera.field_of_view)
    rows, columns = np.indices(depth.shape)
    points = np.zeros(depth.shape, _POINT)
    points["x"], points["y"], points["z"] = (columns - cx) * depth / focal, (rows - cy) * depth / focal, depth
    points["rgb"] = rgb.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], dtype=np.uint32)
    places = zip(("x", "y", "z", "rgb"), _OFFSETS, strict=True)
    return PointCloud2(
        header=head,
        height=camera.height,
        width=camera.width,
        fields=[PointField(name, offset, PointField.FLOAT32, 1) for name, offset in places],
        point_step=_POINT.itemsize,
        row_step=_POINT.itemsize * camera.width,
        data=points.tobytes(),
        is_dense=False,
    )


def camera_info_message(camera: Camera, head: Header, baseline: float = 0.0) -> CameraInfo:
    """Return the message on a camera without distortion; `baseline`: m from the first camera of a pair."""
    focal, cx, cy = pinhole_of(camera.width, camera.height, camera.field_of_view)
    return CameraInfo(
        header=head,
        height=camera.height,
        width=camera.width,
        distortion_model="plumb_bob",
        D=[0.0] * 5,
        K=[focal, 0.0, cx, 0.0, focal, cy, 0.0, 0.0, 1.0],
        R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=[focal, 0.0, cx, -focal * baseline, 0.0, focal, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    )


def joint_states_message(seen: Observation, seconds: float, names: Sequence[str]) -> JointState:
    """Return the states of some joints, at least one, at a sim time in s."""
    positions, velocities, efforts = zip(*(seen.joints[name] for name in names), strict=True)
    return JointState(header(seconds, ""), list(names), positions, velocities, efforts)
