"""Values of messages that are the same in ROS 1 and ROS 2: stamps, twists in other frames, and covariances."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from sim_action.core import geometry

_BILLION: Final = 1_000_000_000


def seconds_and_nanoseconds(time: float) -> tuple[int, int]:
    """Return a sim time in s as whole seconds and the rest in ns, rounded to 1 ns: 0.57 s is not 0.569999999."""
    return divmod(round(time * _BILLION), _BILLION)


def in_frame_of(pose: geometry.Pose, twist: geometry.Twist) -> geometry.Twist:
    """Return a twist in the world frame, in the frame of a pose (nav_msgs/Odometry's child frame)."""
    back = geometry.conjugate(pose.orientation_xyzw)
    return geometry.Twist(geometry.rotate(back, twist.linear_xyz), geometry.rotate(back, twist.angular_xyz))


def diagonal(variances: Sequence[float]) -> tuple[float, ...]:
    """Return a square covariance matrix, row by row, with these variances on its diagonal."""
    size = len(variances)
    return tuple(float(variances[row]) if row == column else 0.0 for row in range(size) for column in range(size))
