"""Kinematics of a robot: poses of its links, its bounding box, limits of its joints, and mobility of its base."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Final

from sim_action.core import geometry, units
from sim_action.core.geometry import ZERO, Box, Pose, Vector3
from sim_action.core.lazy_numpy import NDArray, np
from sim_action.core.records import dataclass
from sim_action.core.wording import did_you_mean
from sim_action.robot.model.robot_model import ENGINE_MARGIN_M, WORLD, Joint, Reading, RobotModel, Shape

# The largest part of a quaternion, beyond which a rotation moves no point by more than 1e-7 of its distance.
_UNTURNED: Final = 1 - 1e-15

_POSITION_ROUNDING: Final = 1e-6  # Models round: a limit may be 1.5707963 where the scenario says 90 deg. In rad, or m.
_SHARE_ROUNDING: Final = 1e-6  # the same as a share of a velocity or effort limit
BASE_FRAME: Final = "base"  # the name of the base link's frame, unless the model has a link with this name


def link_poses(model: RobotModel, positions: Mapping[str, float]) -> dict[str, Pose]:
    """Return the pose of each link in the base frame; `positions`: in rad (m), 0 for joints that are left out."""
    hanging: dict[str, list[Joint]] = {}
    for joint in model.joints:
        hanging.setdefault(joint.parent, []).append(joint)
    poses, waiting = {model.root: Pose()}, [model.root]
    while waiting:
        parent = waiting.pop()
        for joint in hanging.get(parent, []):
            # A link of MJCF may have several joints in series.
            socket = poses.get(joint.child) or geometry.compose(poses[parent], joint.origin)
            poses[joint.child] = geometry.compose(socket, joint_motion(joint, positions.get(joint.name, 0.0)))
        waiting += dict.fromkeys(joint.child for joint in hanging.get(parent, []))
    return poses


def link_of_frame(model: RobotModel, frame: str) -> str:
    """Return the link whose frame "base" or a link's name means; any other name is returned as it is."""
    return model.root if frame == BASE_FRAME and frame not in model.links_by_name else frame


def why_no_link(model: RobotModel, name: str) -> str | None:
    """Return a message with the nearest names if the robot has no link with a name; else None."""
    links = model.links_by_name
    return None if name in links else f"the robot has no link '{name}'{did_you_mean(name, links)}"


def why_no_frame(model: RobotModel, name: str) -> str | None:
    """Return a message if a name is neither "world", "base" nor that of a link; else None."""
    links = model.links_by_name
    if name in links or name in {WORLD, BASE_FRAME}:
        return None
    nearest = did_you_mean(name, [WORLD, BASE_FRAME, *links])
    return f"there is no frame '{name}': a frame is world, base, or a link of the robot{nearest}"


def robot_box(model: RobotModel, poses: Mapping[str, Pose]) -> Box | None:
    """Return the box around all collision shapes in the base frame, if any; tight unless points are unknown."""
    placed = [(poses[link.name], shape) for link in model.links for shape in link.collisions]
    boxes = [(shape_box(geometry.compose(frame, shape.pose), shape), frame, shape) for frame, shape in placed]
    found = [box for box, frame, shape in boxes if not _is_loose(frame, shape)]
    # Reading the points of a mesh takes time. Meshes that reach furthest come first, because others may be inside them.
    for loose, frame, shape in sorted((box for box in boxes if _is_loose(*box[1:])), key=_least_corner):
        around = _around(found) if found else None
        if around is None or not _contains(around, loose):
            found.append(_points_box(frame, shape))
    return _around(found) if found else None


def _least_corner(placed: tuple[Box, Pose, Shape]) -> float:
    lower, upper = placed[0]
    return sum(lower) - sum(upper)


def _is_loose(frame: Pose, shape: Shape) -> bool:
    turned = geometry.multiply(frame.orientation_xyzw, shape.pose.orientation_xyzw)
    return bool(shape.hulls or shape.corners) and max(map(abs, turned)) < _UNTURNED


def _points_box(frame: Pose, shape: Shape) -> Box:
    """Return the box around the points of a mesh whose link is at a pose."""
    points = shape_points(shape)
    rows = list(zip(*(geometry.rotate(frame.orientation_xyzw, unit) for unit in geometry.AXES), strict=True))
    ends = []
    for at, (x, y, z) in zip(frame.position_xyz, rows, strict=True):
        along = x * points[:, 0] + y * points[:, 1] + z * points[:, 2]
        ends.append((at + float(along.min()), at + float(along.max())))
    (ax, bx), (ay, by), (az, bz) = ends
    return (ax, ay, az), (bx, by, bz)


def _around(boxes: Iterable[Box]) -> Box:
    xs, ys, zs = zip(*(corner for box in boxes for corner in box), strict=True)
    return (min(xs), min(ys), min(zs)), (max(xs), max(ys), max(zs))


def _contains(outer: Box, inner: Box) -> bool:
    return all(low <= at for low, at in zip(outer[0], inner[0], strict=True)) and all(
        at <= high for at, high in zip(inner[1], outer[1], strict=True)
    )


def shape_points(shape: Shape) -> NDArray[np.float64]:
    """Return the corners (P, 3) of the hulls of a mesh in m, in the frame of its link."""
    from sim_action.meshes.hull_file import read_unshrunk_points  # a usual run does without it

    if shape.corners:
        points = np.frombuffer(shape.corners, np.float32).reshape(-1, 3).astype(np.float64)
    else:
        points = np.concatenate(read_unshrunk_points(shape.hulls, ENGINE_MARGIN_M))
    rows = zip(*(geometry.rotate(shape.pose.orientation_xyzw, unit) for unit in geometry.AXES), strict=True)
    # Sums of products, written out: the same on every machine.
    along = [x * points[:, 0] + y * points[:, 1] + z * points[:, 2] for x, y, z in rows]
    placed: NDArray[np.float64] = np.stack(along, axis=1)
    return placed + np.array(shape.pose.position_xyz, dtype=np.float64)


def joint_motion(joint: Joint, position: float) -> Pose:
    """Return the motion of the child link's frame from position zero to `position` in rad (m if prismatic)."""
    x, y, z = joint.axis_xyz
    if joint.type == "prismatic":
        return Pose((position * x, position * y, position * z))
    sine = math.sin(position / 2)
    turn = Pose(orientation_xyzw=(sine * x, sine * y, sine * z, math.cos(position / 2)))
    if joint.anchor_xyz == ZERO:
        return turn
    (ax, ay, az), (bx, by, bz) = joint.anchor_xyz, geometry.rotate(turn.orientation_xyzw, joint.anchor_xyz)
    return Pose((ax - bx, ay - by, az - bz), turn.orientation_xyzw)


def shape_box(pose: Pose, shape: Shape) -> Box:
    """Return the box around a shape whose frame is at `pose`."""
    (ax, ay, az), (bx, by, bz) = shape.lower_xyz, shape.upper_xyz
    middle = geometry.compose(pose, Pose(((ax + bx) / 2, (ay + by) / 2, (az + bz) / 2))).position_xyz
    half: Vector3 = ((bx - ax) / 2, (by - ay) / 2, (bz - az) / 2)
    # The rows of the rotation matrix: each axis of the base in the frame of the shape.
    rows = zip(*(geometry.rotate(pose.orientation_xyzw, unit) for unit in geometry.AXES), strict=True)
    x, y, z = (_half_along(row, shape.kind, half) for row in rows)
    return (middle[0] - x, middle[1] - y, middle[2] - z), (middle[0] + x, middle[1] + y, middle[2] + z)


def _half_along(direction: Vector3, kind: str, half: Vector3) -> float:
    """Return the extent in m of a shape from its centre along a direction in its own frame."""
    (x, y, z), (width, depth, height) = direction, half
    if kind == "sphere":
        return width
    if kind == "capsule":
        return width + abs(z) * (height - width)
    if kind == "cylinder":
        return math.hypot(x, y) * width + abs(z) * height
    return abs(x) * width + abs(y) * depth + abs(z) * height


def beyond_limits(joint: Joint, position: float) -> str | None:
    """Return a message if a position in rad (m if prismatic) is outside the limits of a joint, else None."""
    lower, upper = joint.range
    if lower - _POSITION_ROUNDING <= position <= upper + _POSITION_ROUNDING:
        return None
    unit = joint.dimension("position").si
    at, passed = units.display_apart(position, lower if position < lower else upper, unit)
    low, high = (passed, units.display(upper, unit)) if position < lower else (units.display(lower, unit), passed)
    bounds = f"{low} or more" if math.isinf(upper) else f"{high} or less" if math.isinf(lower) else f"{low} to {high}"
    return f"{at} is outside the limits of the joint, {bounds}"


def too_fast(joint: Joint, speed: float) -> str | None:
    """Return a message if a speed in rad/s (m/s), in either direction, exceeds the velocity limit, else None."""
    return _too_much(joint, "velocity", speed, joint.max_velocity)


def too_strong(joint: Joint, effort: float) -> str | None:
    """Return a message if an effort in N m (N), in either direction, exceeds the effort limit, else None."""
    return _too_much(joint, "effort", effort, joint.max_effort)


def _too_much(joint: Joint, reading: Reading, value: float, limit: float | None) -> str | None:
    if limit is None or abs(value) <= limit * (1 + _SHARE_ROUNDING):
        return None
    found, most = units.display_apart(abs(value), limit, joint.dimension(reading).si)
    return f"{found} is more than the joint's {reading} limit, {most}"


@dataclass(frozen=True, slots=True)
class Mobility:
    """The motions that a drive allows; by default those of a robot that turns in place about its base link's origin."""

    heading: float = 0.0  # rad, direction of forward motion, from the base's x axis to the left
    ahead: float = 0.0  # m, along the heading, from the axle about which the robot turns to the base link's origin
    tightest: float = math.inf  # 1/m, the largest curvature that it can drive; inf if it turns in place
    acceleration: float = 1.0  # m/s^2, limit of the forward acceleration
    turn_acceleration: float = 1.0  # rad/s^2, limit of the angular acceleration when it turns in place
    wheelbase: float = 0.0  # m, from the fixed axle to the steered one; 0 if no wheel is steered
    # m/s, the speed at the rim of the fastest wheel at the limit of its joint; inf without such limits
    fastest: float = math.inf

    @property
    def turns_in_place(self) -> bool:
        """Return True if the robot can turn in place."""
        return math.isinf(self.tightest)

    @property
    def turning_radius(self) -> float:
        """The smallest turning radius, in m."""
        return 1 / self.tightest


@dataclass(frozen=True, slots=True, eq=False)
class SameModel:
    """A model as a key of a cache: compared by identity, because comparing its contents would be slow."""

    model: RobotModel

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SameModel) and other.model is self.model

    def __hash__(self) -> int:
        return id(self.model)
