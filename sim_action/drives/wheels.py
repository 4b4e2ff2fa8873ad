"""The wheels of a robot model: joints, tyres, radii, positions, axles, rolling direction and ground contact.

Forward is the base's x axis (REP 103), unless the wheels roll another way: r2d2 of `pybullet_data` rolls along its y
axis.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from heapq import heapify, heappop, heappush
from itertools import pairwise
from types import MappingProxyType
from typing import Final

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Vector3
from sim_action.core.lazy_numpy import NDArray, np
from sim_action.core.records import dataclass
from sim_action.core.yaml_document import SpecProblems
from sim_action.robot.model.kinematics import SameModel, link_poses, shape_box, shape_points
from sim_action.robot.model.robot_model import Joint, Link, RobotModel, Shape

MAX_AXLE_DEVIATION: Final = 0.1
"""Maximum component of an axle, as a unit vector, along a direction to which it is perpendicular."""

MIN_UPRIGHT_Z: Final = 0.8  # an axis with at least this z component, as a unit vector, counts as upright
_PARALLEL: Final = 0.99  # the least product of two unit vectors that count as parallel
MAX_LIFT_SHARE: Final = 0.1
"""A wheel on the ground ends at most this share of its radius above the lowest point of the robot."""

# An axle with a greater component, as a unit vector, is not level or not perpendicular to the heading.
_MAX_TILT_COMPONENT: Final = 0.5
_ROUNDING: Final = 1e-9


@dataclass(frozen=True, slots=True)
class Wheel:
    """A wheel with all joints at their initial positions."""

    joint: str  # name of the joint that turns it
    radius: float | None  # radius in m; None if the model does not state it
    position_xyz: Vector3  # centre of its round shape, or of its link if it has none; m, base frame
    axis_xyz: Vector3  # axis of the joint; unit vector, base frame
    width: float = 0.0  # length in m of the line on which it stands; 0 for a sphere, or if the model does not state it


def wheel(model: RobotModel, joint_name: str) -> Wheel:
    """Return the wheel that a joint turns. Raises KeyError if the model has no such joint."""
    return _wheel_at_home(SameModel(model), joint_name)


def opposed_note(axes: Mapping[str, Vector3], plugin: str = "") -> str | None:
    """Return a note about wheels whose axis points against the other axes, else None.

    :param plugin: the plugin that drives them; empty for a drive of the scenario, which corrects the direction.
    :param axes: joint of each wheel -> its axis, unit vector in the base frame. Of two groups of the same size, the one
        that turns about the base's -y axis is named.
    """
    if not axes:
        return None
    _, (x, y, z) = next(iter(axes.items()))
    along = {name: axis[0] * x + axis[1] * y + axis[2] * z for name, axis in axes.items()}
    groups = [[name for name in axes if sign * along[name] > _PARALLEL] for sign in (1, -1)]
    fewer = min(groups, key=lambda group: (len(group), sum(axes[name][1] for name in group)))
    if not fewer:
        return None
    names = ", ".join(f"'{name}'" for name in fewer)
    opposed = (
        f"joint{'s' * (len(fewer) > 1)} {names}: the axis points against that of the other wheels, so that a positive "
        "velocity rolls backward"
    )
    if plugin:
        return f"{opposed}, and the robot turns where it should drive ahead, as with {plugin}; reverse the axis"
    return f"{opposed}, and the drive turns it the other way; if this is a mistake, reverse the axis"


def wheels_on_ground(model: RobotModel, max_lift_share: float = MAX_LIFT_SHARE) -> tuple[Wheel, ...]:
    """Return round links on level continuous joints that are as low as any part of the robot.

    :param max_lift_share: the most that a wheel may end above the lowest part, as a share of its radius.
    """
    ground = lowest_shape(model)
    if ground is None:
        return ()
    return tuple(
        round_wheel for round_wheel in round_wheels(model) if is_on_ground(round_wheel, ground, max_lift_share)
    )


def round_wheels(model: RobotModel) -> tuple[Wheel, ...]:
    """Return round links on level continuous joints, at any height."""
    return _round_wheels(SameModel(model))


# A drive and its notes ask for it several times, and up to 10,000 variations share one model.
@lru_cache(maxsize=4)
def _round_wheels(same: SameModel) -> tuple[Wheel, ...]:
    model = same.model
    level = (joint for joint in model.joints if joint.type == "continuous" and is_level(model, joint))
    return tuple(wheel(model, joint.name) for joint in level if isinstance(tyre(model, joint), Tyre))


def held_joints(model: RobotModel) -> frozenset[str]:
    """Return the joints that a servo holds at their initial positions until they get a command.

    These are the joints with limits, and continuous joints with an effort limit. Not held are joints with a spring or
    a mimic, and continuous joints that turn or carry a wheel. Here, a wheel is a link on a level axis that is called
    a wheel, or that is round about the axis, ends at most a radius above the lowest shape, and carries no moving joint.
    """
    able = [joint for joint in model.motor_joints if not (joint.mimic or joint.stiffness or joint.series)]
    turning = [joint for joint in able if joint.type == "continuous" and joint.max_effort and model.mjcf is None]
    wheels = [joint.name for joint in turning if _may_roll(model, joint)]
    rolling = {*wheels, *(above.name for name in wheels for above in joints_above(model, name))}
    held = {joint.name for joint in turning} - rolling
    return frozenset(held.union(joint.name for joint in able if joint.type != "continuous"))


def _may_roll(model: RobotModel, joint: Joint) -> bool:
    """Return True for a link that is called a wheel, or that is round, near the ground, and carries no moving joint."""
    ground = lowest_shape(model)
    if ground is None or not is_level(model, joint):
        return False
    if "wheel" in joint.name.lower() or "wheel" in joint.child.lower():
        return True
    if not isinstance(tyre(model, joint), Tyre) or not is_on_ground(wheel(model, joint.name), ground, 1.0):
        return False
    return all(joint not in joints_above(model, other.name) for other in model.moving_joints)


def axis_in_base(model: RobotModel, joint: Joint) -> Vector3:
    """Return the axis of a joint as a unit vector in the base frame, with all joints at their initial positions."""
    return _axis(joint, _poses(model))


def is_level(model: RobotModel, joint: Joint) -> bool:
    """Return True if the axis of a joint is level."""
    return abs(_axis(joint, _poses(model))[2]) <= MAX_AXLE_DEVIATION


def is_on_ground(round_wheel: Wheel, ground: Lowest, max_lift_share: float = MAX_LIFT_SHARE) -> bool:
    """Return True if a wheel is as low as the lowest shape of the robot."""
    radius = round_wheel.radius or 0.0
    return round_wheel.position_xyz[2] - radius < ground.z + max_lift_share * radius


def stands(model: RobotModel, link_name: str, ground: Lowest) -> bool:
    """Return True if the box around a shape of a link is as low as the lowest shape of the robot."""
    pose = _poses(model)[link_name]
    boxes = (
        shape_box(geometry.compose(pose, shape.pose), shape) for shape in model.links_by_name[link_name].collisions
    )
    return any(low[2] < ground.z + MAX_LIFT_SHARE * (high[2] - low[2]) / 2 for low, high in boxes)


def tyre(model: RobotModel, joint: Joint) -> Tyre | NotRound:
    """Return the tyre of the link that a joint turns, in the frame of the link, or the reason why it has none."""
    return tyre_of(model.links_by_name[joint.child], joint)


@dataclass(frozen=True, slots=True)
class Lowest:
    """The lowest collision shape of a robot: its lowest z in m, base frame, its link and its kind."""

    z: float
    link: str
    kind: str


def lowest_shape(model: RobotModel) -> Lowest | None:
    """Return the lowest collision shape, with all joints at their initial positions; None if there are no shapes."""
    return _lowest_at_home(SameModel(model))


def joints_above(model: RobotModel, joint_name: str) -> Iterator[Joint]:
    """Yield the moving joints between a wheel and the base, from below."""
    above = {joint.child: joint for joint in model.joints}
    link = model.joints_by_name[joint_name].parent
    while link in above:
        if above[link].moves:
            yield above[link]
        link = above[link].parent


def steering_joint(model: RobotModel, joint_name: str) -> Joint | None:
    """Return the nearest joint above a wheel's joint that turns about an upright axis, else None.

    Suspensions and beams in between, which slide or tilt, are not steering joints.
    """
    poses = _poses(model)
    turning = (joint for joint in joints_above(model, joint_name) if joint.type != "prismatic")
    return next((joint for joint in turning if abs(_axis(joint, poses)[2]) >= MIN_UPRIGHT_Z), None)


def centre_of_mass(model: RobotModel) -> Vector3:
    """Return the centre of mass of all links in m, base frame, with all joints at their initial positions."""
    poses = _poses(model)
    x = y = z = 0.0
    for link in model.links:
        at = geometry.compose(poses[link.name], Pose(link.centre_of_mass_xyz)).position_xyz
        share = (link.mass or 0.0) / model.mass if model.mass else 0.0
        x, y, z = x + share * at[0], y + share * at[1], z + share * at[2]
    return x, y, z


def _poses(model: RobotModel) -> Mapping[str, Pose]:
    return _poses_at_home(SameModel(model))


# A drive calls this dozens of times, and up to 10,000 variations share one model.
@lru_cache(maxsize=4)
def _poses_at_home(same: SameModel) -> Mapping[str, Pose]:
    return MappingProxyType(link_poses(same.model, same.model.positions({})))


@lru_cache(maxsize=64)
def _wheel_at_home(same: SameModel, joint_name: str) -> Wheel:
    return _wheel(same.model, same.model.joints_by_name[joint_name], _poses(same.model))


def _wheel(model: RobotModel, joint: Joint, poses: Mapping[str, Pose]) -> Wheel:
    pose, own_tyre, axis = poses[joint.child], tyre(model, joint), _axis(joint, poses)
    if isinstance(own_tyre, Tyre):
        middle = geometry.compose(pose, Pose(own_tyre.middle_xyz))
        return Wheel(joint.name, own_tyre.radius, middle.position_xyz, axis, own_tyre.width)
    # A scenario may name a wheel that does not roll true; its first round shape still has a radius.
    shapes = model.links_by_name[joint.child].collisions
    shape = next((shape for shape in shapes if shape.radius is not None), None)
    middle = geometry.compose(pose, shape.pose) if shape else pose
    width = shape.upper_xyz[2] - shape.lower_xyz[2] if shape and shape.kind == "cylinder" else 0.0
    return Wheel(joint.name, shape.radius if shape else None, middle.position_xyz, axis, width)


def _axis(joint: Joint, poses: Mapping[str, Pose]) -> Vector3:
    return geometry.rotate(poses[joint.child].orientation_xyzw, joint.axis_xyz)


@lru_cache(maxsize=4)
def _lowest_at_home(same: SameModel) -> Lowest | None:
    """Return the lowest shape. Boxes around tilted meshes are too large, so the lowest of them are measured."""
    model, poses = same.model, _poses(same.model)
    shapes = [(poses[link.name], link.name, shape) for link in model.links for shape in link.collisions]
    waiting = [
        (shape_box(geometry.compose(pose, shape.pose), shape)[0][2], number, False)
        for number, (pose, _, shape) in enumerate(shapes)
    ]
    heapify(waiting)
    while waiting:
        z, number, is_exact = heappop(waiting)
        pose, link, shape = shapes[number]
        if is_exact or not (shape.hulls or shape.corners):
            return Lowest(z, link, shape.kind)
        heappush(waiting, (_lowest_point(pose, shape), number, True))
    return None


def _lowest_point(pose: Pose, shape: Shape) -> float:
    x, y, z = (geometry.rotate(pose.orientation_xyzw, unit)[2] for unit in ((1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0)))
    points = shape_points(shape)
    return float((x * points[:, 0] + y * points[:, 1] + z * points[:, 2]).min()) + pose.position_xyz[2]


@dataclass(frozen=True, slots=True)
class Rolling:
    """A wheel relative to the forward direction of its drive."""

    joint: str  # name of the joint that turns it
    ahead: float  # ahead, left: position relative to the base's origin in m
    left: float
    turns: float  # 1 if it rolls forward when its joint turns forward, -1 if its axis points the other way


def heading_of(wheels: Sequence[Wheel], left: Sequence[Wheel] = (), right: Sequence[Wheel] = ()) -> float:
    """Return the rolling direction of wheels in rad from the base's x axis.

    Of the two directions it is the one with `left` on the left, or without sides the one nearer to x.
    """
    x, y = _along_axles(wheels)
    length = math.hypot(x, y)
    if length < _ROUNDING:
        return 0.0
    x, y = x / length, y / length
    to_left = _lateral(x, y, left) - _lateral(x, y, right) if left and right else 0.0
    has_sides = abs(to_left) > _ROUNDING
    is_backward = to_left < 0 if has_sides else x < -_ROUNDING or (x <= _ROUNDING and y < 0)
    return (math.atan2(-y, -x) if is_backward else math.atan2(y, x)) + 0.0


def turned_forward(wheels: Sequence[Wheel]) -> float | None:
    """Return the direction in which wheels roll if all joints turn forward, in rad; None if they disagree."""
    x = sum(wheel.axis_xyz[1] for wheel in wheels)
    y = -sum(wheel.axis_xyz[0] for wheel in wheels)
    # Rounded, because users paste it from messages.
    return round(math.atan2(y, x), 9) + 0.0 if math.hypot(x, y) > _MAX_TILT_COMPONENT * len(wheels) else None


def rolling(wheel: Wheel, heading: float) -> Rolling:
    """Return a wheel relative to the forward direction of its drive."""
    cosine, sine = math.cos(heading), math.sin(heading)
    x, y, _ = wheel.position_xyz
    turns = math.copysign(1.0, _rolls_along(wheel, heading))
    return Rolling(wheel.joint, cosine * x + sine * y, cosine * y - sine * x, turns)


def largest_radius(wheels: Sequence[Wheel]) -> float:
    """Return the largest radius in m, 0 if the model states none."""
    return max((wheel.radius for wheel in wheels if wheel.radius), default=0.0)


def along(heading: float, ahead: float, left: float) -> tuple[float, float]:
    """Return a vector given ahead and to the left, along the axes of the base."""
    cosine, sine = math.cos(heading), math.sin(heading)
    return cosine * ahead - sine * left, sine * ahead + cosine * left


def axle_problems(wheel: Wheel, heading: float) -> SpecProblems:
    """Yield a joint that would not roll a wheel forward."""
    if abs(wheel.axis_xyz[2]) > _MAX_TILT_COMPONENT:
        yield (), f"joint '{wheel.joint}' turns about an upright axis in the model: it cannot be a wheel"
    elif abs(_rolls_along(wheel, heading)) < _MAX_TILT_COMPONENT:
        yield (), f"the wheel at '{wheel.joint}' rolls across the others; give 'heading', the direction of forward"


def _rolls_along(wheel: Wheel, heading: float) -> float:
    x, y, _ = wheel.axis_xyz
    # A wheel that turns about y rolls along x.
    return math.cos(heading) * y - math.sin(heading) * x


def _along_axles(wheels: Sequence[Wheel]) -> tuple[float, float]:
    """Return the sum of the rolling directions of wheels, each reversed if it opposes the first."""
    first_x, first_y = wheels[0].axis_xyz[1], -wheels[0].axis_xyz[0]
    total_x = total_y = 0.0
    for wheel in wheels:
        x, y = wheel.axis_xyz[1], -wheel.axis_xyz[0]
        way = math.copysign(1.0, x * first_x + y * first_y)
        total_x, total_y = total_x + way * x, total_y + way * y
    return total_x, total_y


def _lateral(x: float, y: float, wheels: Sequence[Wheel]) -> float:
    return sum(x * wheel.position_xyz[1] - y * wheel.position_xyz[0] for wheel in wheels) / len(wheels)


MAX_UNROUNDNESS: Final = 0.03
"""Maximum deviation of a corner of the outline from a circle about the axis, as a share of its radius."""

MIN_CORNERS: Final = 8  # the least number of corners of a circle: neighbours are at most a turn over this number apart

# Directions in which the outline of a mesh is measured.
_DIRECTIONS: Final = 720
_AT_A_TIME: Final = 48
_ANGLE_ROUNDING: Final = 1e-3  # tolerance of an angle between neighbours: meshes have 6 digits
# An axis of a cylinder with a smaller component along the joint's axis, as a unit vector, is not parallel to it.
_MIN_PARALLEL: Final = 0.995


@dataclass(frozen=True, slots=True)
class Tyre:
    """The round part of a link about a joint's axis.

    A link is round if its outline is: seen along the axis, all corners of the convex hull lie within `MAX_UNROUNDNESS`
    of one circle about the axis, and no two neighbours are further apart than corners of an octagon.
    """

    radius: float  # m; a mesh rolls as far as a circle with the length of its outline
    middle_xyz: Vector3  # its centre in m, in the frame of the link
    width: float  # length in m of the line on which it stands; 0 for a sphere
    kind: str  # of its shape


@dataclass(frozen=True, slots=True)
class NotRound:
    """The reason why a link is not round about an axis; continues a sentence that begins with the link."""

    reason: str


def tyre_of(link: Link, joint: Joint) -> Tyre | NotRound:
    """Return the tyre of the link that a joint turns, in the link's frame, or the reason why it has none."""
    if not link.collisions:
        only = ", only visuals: nothing of it touches the ground" if link.visuals else ""
        return NotRound(f"has no collision shape{only}")
    tyres = list[Tyre]()
    reach = 0.0
    others = list[NotRound]()
    for shape in link.collisions:
        candidate = _tyre_of(shape, joint.axis_xyz, joint.anchor_xyz)
        if isinstance(candidate, Tyre):
            tyres.append(candidate)
        else:
            others.append(candidate)
            reach = max(reach, _reach(shape, joint))
    if not tyres:
        return others[0]
    largest = max(tyre.radius for tyre in tyres)
    if reach > largest * (1 + MAX_UNROUNDNESS):
        return others[0]
    return _together([tyre for tyre in tyres if tyre.radius > largest * (1 - MAX_UNROUNDNESS)], joint)


def _together(tyres: Sequence[Tyre], joint: Joint) -> Tyre:
    """Return tyres on one axis as one tyre."""
    if len(tyres) == 1:
        return tyres[0]
    places = [geometry.dot(geometry.subtract(tyre.middle_xyz, joint.anchor_xyz), joint.axis_xyz) for tyre in tyres]
    low = min(place - tyre.width / 2 for place, tyre in zip(places, tyres, strict=True))
    high = max(place + tyre.width / 2 for place, tyre in zip(places, tyres, strict=True))
    middle = _plus(joint.anchor_xyz, joint.axis_xyz, (low + high) / 2)
    return Tyre(max(tyre.radius for tyre in tyres), middle, high - low, tyres[0].kind)


def _tyre_of(shape: Shape, axis: Vector3, anchor: Vector3) -> Tyre | NotRound:
    if shape.kind == "mesh":
        return _mesh_tyre(shape, axis, anchor)
    if shape.radius is None or shape.kind not in {"cylinder", "sphere", "capsule"}:
        return NotRound(f"is a {shape.kind}, which is not round")
    middle = shape.pose.position_xyz
    along = abs(geometry.dot(geometry.rotate(shape.pose.orientation_xyzw, (0.0, 0.0, 1.0)), axis))
    if shape.kind != "sphere" and along < _MIN_PARALLEL:
        return NotRound(f"is a {shape.kind}, which does not lie along the joint's axis")
    off = _off_axis(middle, axis, anchor)
    if off > MAX_UNROUNDNESS / 2 * shape.radius:
        return NotRound(f"is a {shape.kind}, whose centre is {off:.3g} m from the joint's axis")
    length = shape.upper_xyz[2] - shape.lower_xyz[2]
    width = {"cylinder": length, "capsule": length - 2 * shape.radius}.get(shape.kind, 0.0)
    return Tyre(shape.radius, middle, width, shape.kind)


def _reach(shape: Shape, joint: Joint) -> float:
    """Return the greatest distance in m of a shape's box from the joint's axis."""
    corners = [
        geometry.compose(shape.pose, Pose((x, y, z))).position_xyz
        for x in (shape.lower_xyz[0], shape.upper_xyz[0])
        for y in (shape.lower_xyz[1], shape.upper_xyz[1])
        for z in (shape.lower_xyz[2], shape.upper_xyz[2])
    ]
    return max(_off_axis(corner, joint.axis_xyz, joint.anchor_xyz) for corner in corners)


def _off_axis(point: Vector3, axis: Vector3, anchor: Vector3) -> float:
    way = geometry.subtract(point, anchor)
    return math.dist(_plus((0.0, 0.0, 0.0), axis, geometry.dot(way, axis)), way)


@lru_cache(maxsize=64)
def _mesh_tyre(shape: Shape, axis: Vector3, anchor: Vector3) -> Tyre | NotRound:
    """Return the tyre of a mesh, from its hulls."""
    if not (shape.hulls or shape.corners):
        return NotRound("is a mesh whose shape is not known here")
    points = shape_points(shape) - np.array(anchor)
    first, second = _across(axis)
    across = np.stack([_along(points, first), _along(points, second)])
    corners = _outline(across)
    if len(corners) < MIN_CORNERS - 1:
        return NotRound(f"is a mesh that is not round about the joint's axis: its outline has {len(corners)} corners")
    radii = [math.hypot(*corner) for corner in corners]
    if min(radii) < (1 - MAX_UNROUNDNESS) * max(radii):
        ends = f"the corners of its outline are {min(radii):.3g} m to {max(radii):.3g} m from it"
        return NotRound(f"is a mesh that is not round about the joint's axis: {ends}")
    angles = sorted(math.atan2(y, x) for x, y in corners)
    widest = max(after - before for before, after in pairwise((*angles, angles[0] + 2 * math.pi)))
    if widest > 2 * math.pi / MIN_CORNERS + _ANGLE_ROUNDING:
        gap = f"two corners of its outline are {math.degrees(widest):.3g} deg apart"
        return NotRound(f"is a mesh that is not round about the joint's axis: {gap}")
    places = _along(points, axis)
    rim = places[np.hypot(across[0], across[1]) > (1 - MAX_UNROUNDNESS) * max(radii)]
    low, high = float(rim.min()), float(rim.max())
    length = math.fsum(math.dist(*pair) for pair in zip(corners, (*corners[1:], corners[0]), strict=True))
    return Tyre(length / (2 * math.pi), _plus(anchor, axis, (low + high) / 2), high - low, shape.kind)


def _outline(across: NDArray[np.float64]) -> list[tuple[float, float]]:
    """Return the corners of the convex hull of points (2, P), counter-clockwise, as seen in many directions."""
    angles = np.arange(_DIRECTIONS) * (2 * np.pi / _DIRECTIONS)
    rows: list[int] = []
    for start in range(0, _DIRECTIONS, _AT_A_TIME):
        turned = angles[start : start + _AT_A_TIME, None]
        # Sums of products, written out: the same on every machine.
        rows += (np.cos(turned) * across[0] + np.sin(turned) * across[1]).argmax(axis=1).tolist()
    corners = [(float(across[0, row]), float(across[1, row])) for row in dict.fromkeys(rows)]
    return [corner for corner, near in zip(corners, (*corners[1:], corners[0]), strict=True) if corner != near]


def _across(axis: Vector3) -> tuple[Vector3, Vector3]:
    """Return two unit vectors across an axis."""
    x, y, z = axis
    least = min(range(3), key=lambda place: abs(axis[place]))
    ux, uy, uz = geometry.AXES[least]
    cross = (y * uz - z * uy, z * ux - x * uz, x * uy - y * ux)
    length = math.hypot(*cross)
    a, b, c = (part / length for part in cross)
    return (a, b, c), (y * c - z * b, z * a - x * c, x * b - y * a)


def _along(points: NDArray[np.float64], direction: Sequence[float]) -> NDArray[np.float64]:
    length: NDArray[np.float64] = (
        points[:, 0] * direction[0] + points[:, 1] * direction[1] + points[:, 2] * direction[2]
    )
    return length


def _plus(start: Vector3, direction: Vector3, way: float) -> Vector3:
    return start[0] + way * direction[0], start[1] + way * direction[1], start[2] + way * direction[2]
