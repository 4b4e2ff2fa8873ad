"""Where the links of a robot are, and how much room its collision shapes take."""

from __future__ import annotations

import math
from collections.abc import Mapping

from sim_action.core import geometry
from sim_action.core.geometry import Box, Pose, Vector3
from sim_action.robot.robot_model import Joint, RobotModel, Shape


def link_poses(model: RobotModel, positions: Mapping[str, float]) -> dict[str, Pose]:
    """Link name -> its pose in the base frame, for joint positions in rad, or m; a joint left out is at 0."""
    hanging: dict[str, list[Joint]] = {}
    for joint in model.joints:
        hanging.setdefault(joint.parent, []).append(joint)
    poses, waiting = {model.root: Pose()}, [model.root]
    while waiting:
        parent = waiting.pop()
        for joint in hanging.get(parent, []):
            socket = geometry.compose(poses[parent], joint.origin)
            poses[joint.child] = geometry.compose(socket, _motion(joint, positions.get(joint.name, 0.0)))
            waiting.append(joint.child)
    return poses


def robot_box(model: RobotModel, poses: Mapping[str, Pose]) -> Box | None:
    """The box around all collision shapes, in the base frame; None if there are none.

    It is tight but for meshes that are turned: of these it is known how long they are along their own axes.
    """
    shapes = ((poses[link.name], shape) for link in model.links for shape in link.collisions)
    boxes = [_box(geometry.compose(frame, shape.pose), shape) for frame, shape in shapes]
    if not boxes:
        return None
    xs, ys, zs = zip(*(corner for box in boxes for corner in box), strict=True)
    return (min(xs), min(ys), min(zs)), (max(xs), max(ys), max(zs))


def _motion(joint: Joint, position: float) -> Pose:
    x, y, z = joint.axis_xyz
    if joint.type == "prismatic":
        return Pose((position * x, position * y, position * z))
    sine = math.sin(position / 2)
    return Pose(orientation_xyzw=(sine * x, sine * y, sine * z, math.cos(position / 2)))


def _box(pose: Pose, shape: Shape) -> Box:
    """Around a shape whose frame is at `pose`."""
    (ax, ay, az), (bx, by, bz) = shape.lower_xyz, shape.upper_xyz
    middle = geometry.compose(pose, Pose(((ax + bx) / 2, (ay + by) / 2, (az + bz) / 2))).position_xyz
    half: Vector3 = ((bx - ax) / 2, (by - ay) / 2, (bz - az) / 2)
    # Row by row, the matrix of the rotation: how each axis of the base is seen from the shape.
    rows = zip(*(geometry.rotate(pose.orientation_xyzw, unit) for unit in _UNITS), strict=True)
    x, y, z = (_half_along(row, shape.kind, half) for row in rows)
    return (middle[0] - x, middle[1] - y, middle[2] - z), (middle[0] + x, middle[1] + y, middle[2] + z)


def _half_along(direction: Vector3, kind: str, half: Vector3) -> float:
    """How far a shape reaches from its middle along a direction in its own frame."""
    (x, y, z), (width, depth, height) = direction, half
    if kind == "sphere":
        return width
    if kind == "capsule":
        return width + abs(z) * (height - width)
    if kind == "cylinder":
        return math.hypot(x, y) * width + abs(z) * height
    return abs(x) * width + abs(y) * depth + abs(z) * height


_UNITS: tuple[Vector3, ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
