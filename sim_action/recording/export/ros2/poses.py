"""Many poses at once: (N, 7) arrays of x, y, z in m and unit quaternions x, y, z, w, as messages have them."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Quaternion, Vector3
from sim_action.robot.robot_model import Joint
from sim_action.state.trace import FloatArray


def of_pose(pose: Pose, count: int = 1) -> FloatArray:
    """The same pose many times."""
    return np.tile([*pose.position_xyz, *pose.orientation_xyzw], (count, 1))


def composed(outer: FloatArray, inner: FloatArray) -> FloatArray:
    """`geometry.compose` of each pair."""
    return _array(geometry.compose(_pose(outer), _pose(inner)))


def inverted(poses: FloatArray) -> FloatArray:
    """`geometry.inverse` of each."""
    return _array(geometry.inverse(_pose(poses)))


def seen_from(orientations: FloatArray, vectors: FloatArray) -> FloatArray:
    """(N, 3) vectors of the world in frames that are turned so, (N, 4)."""
    back = geometry.conjugate(cast(Quaternion, tuple(orientations.T)))
    return np.column_stack(geometry.rotate(back, cast(Vector3, tuple(vectors.T))))


def moved_by(joint: Joint, positions: FloatArray) -> FloatArray:
    """(N, 7) the child link's frame in the parent link's, for joint positions (N,) in rad, or m."""
    motion = np.zeros((len(positions), 7))
    if joint.type == "prismatic":
        motion[:, :3], motion[:, 6] = positions[:, None] * joint.axis_xyz, 1.0
    else:
        motion[:, 3:6], motion[:, 6] = np.sin(positions / 2)[:, None] * joint.axis_xyz, np.cos(positions / 2)
    return composed(of_pose(joint.origin, len(positions)), motion)


def _pose(poses: FloatArray) -> Pose:
    """What geometry says of one pose holds of columns of many."""
    columns: Any = tuple(poses.T)
    return Pose(columns[:3], columns[3:])


def _array(pose: Pose) -> FloatArray:
    return np.column_stack((*pose.position_xyz, *pose.orientation_xyzw))
