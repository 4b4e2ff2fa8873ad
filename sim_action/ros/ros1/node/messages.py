"""From types of ours to messages of ROS, and back."""

from __future__ import annotations

from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3
from rospy import Time
from std_msgs.msg import Header

from sim_action.core import geometry

_BILLION = 1_000_000_000


def time_of(seconds: float) -> Time:
    """A sim time; rounded to 1 ns, so that 0.57 s is not 0.569999999."""
    whole, rest = divmod(round(seconds * _BILLION), _BILLION)
    return Time(whole, rest)


def header(seconds: float, frame: str) -> Header:
    """Of what was measured at a sim time."""
    return Header(stamp=time_of(seconds), frame_id=frame)


def pose_message(pose: geometry.Pose) -> Pose:
    """A pose."""
    return Pose(Point(*pose.position_xyz), Quaternion(*pose.orientation_xyzw))


def twist_message(twist: geometry.Twist) -> Twist:
    """A twist."""
    return Twist(Vector3(*twist.linear_xyz), Vector3(*twist.angular_xyz))


def pose_of(message: Pose) -> geometry.Pose:
    """A pose; one whose rotation was left at zeros is not turned."""
    at, turned = message.position, message.orientation
    rotation = (turned.x, turned.y, turned.z, turned.w)
    return geometry.Pose((at.x, at.y, at.z), rotation if any(rotation) else geometry.IDENTITY)


def twist_of(message: Twist) -> geometry.Twist:
    """A twist."""
    linear, angular = message.linear, message.angular
    return geometry.Twist((linear.x, linear.y, linear.z), (angular.x, angular.y, angular.z))


def in_frame_of(pose: geometry.Pose, twist: geometry.Twist) -> geometry.Twist:
    """A twist in the world frame, as it is seen in the frame of a pose (nav_msgs/Odometry's child frame)."""
    back = geometry.conjugate(pose.orientation_xyzw)
    return geometry.Twist(geometry.rotate(back, twist.linear_xyz), geometry.rotate(back, twist.angular_xyz))
