"""Conversions between plain data, our types, and messages of rospy."""

from __future__ import annotations

from array import array
from typing import Any, Final

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3
from roslib.message import get_message_class
from rospy import Time
from sensor_msgs.msg import PointField
from std_msgs.msg import Header

from sim_action.core import geometry
from sim_action.core.lazy_numpy import NDArray
from sim_action.ros import messages
from sim_action.ros.messages import Message
from sim_action.ros.robot_topics import pinhole_of, seconds_and_nanoseconds
from sim_action.sensors.camera import Camera

# As the Point Cloud Library lays out a point with a colour.
_OFFSETS: Final = {"x": 0, "y": 4, "z": 8, "rgb": 16}
_POINT: Final = np.dtype(
    {"names": [*_OFFSETS], "formats": ["<f4", "<f4", "<f4", "<u4"], "offsets": [*_OFFSETS.values()], "itemsize": 32}
)


def filled(kind: type[Any], data: Message) -> Any:
    """Return a message with the fields of plain data; the others keep their defaults. ROS 1 writes K for k."""
    message = kind()
    for name, value in data.items():
        field = name if hasattr(message, name) else name.upper()
        setattr(message, field, _value(message, field, value))
    return message


def _value(message: Any, field: str, value: Any) -> Any:
    if isinstance(value, dict):
        is_time = "nanosec" in value
        return Time(value["sec"], value["nanosec"]) if is_time else filled(type(getattr(message, field)), value)
    if isinstance(value, list) and value and isinstance(value[0], dict):
        kind = get_message_class(message._slot_types[message.__slots__.index(field)].rstrip("[]"))  # noqa: SLF001 - genpy has no other way
        return [filled(kind, fields) for fields in value]
    return value.tobytes() if isinstance(value, array) and value.typecode == "B" else value


def header(seconds: float, frame: str) -> Header:
    """Return the header of a measurement at a sim time."""
    return Header(stamp=Time(*seconds_and_nanoseconds(seconds)), frame_id=frame)


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


def points_message(
    seconds: float, frame: str, camera: Camera, depth: NDArray[np.float32], rgb: NDArray[np.uint8]
) -> Message:
    """Return sensor_msgs/PointCloud2: the point that each pixel shows, in the optical frame, with its colour."""
    focal, cx, cy = pinhole_of(camera.width, camera.height, camera.field_of_view)
    rows, columns = np.indices(depth.shape)
    points = np.zeros(depth.shape, _POINT)
    points["x"], points["y"], points["z"] = (columns - cx) * depth / focal, (rows - cy) * depth / focal, depth
    points["rgb"] = rgb.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], dtype=np.uint32)
    kind = {"datatype": PointField.FLOAT32, "count": 1}
    return {
        "header": messages.header(seconds, frame),
        "height": camera.height,
        "width": camera.width,
        "fields": [{"name": name, "offset": offset, **kind} for name, offset in _OFFSETS.items()],
        "point_step": _POINT.itemsize,
        "row_step": _POINT.itemsize * camera.width,
        "data": points.tobytes(),
        "is_dense": False,
    }
