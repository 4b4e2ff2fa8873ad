"""The round outline of a link about a joint's axis: a tyre, with its radius, centre and width, or the reason for none.

A link is round if its outline is: seen along the axis, all corners of the convex hull lie within `MAX_UNROUNDNESS` of
one circle about the axis, and no two neighbours are further apart than those of an octagon.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Final

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Vector3
from sim_action.core.lazy_numpy import NDArray, np
from sim_action.core.records import dataclass
from sim_action.robot.model.kinematics import shape_points
from sim_action.robot.model.robot_model import Joint, Link, Shape

MAX_UNROUNDNESS: Final = 0.03
"""Maximum deviation of a corner of the outline from a circle about the axis, as a share of its radius."""

MIN_CORNERS: Final = 8  # the least number of corners of a circle: neighbours are at most a turn over this number apart

# Directions in which the outline of a mesh is measured.
_DIRECTIONS: Final = 720
_AT_A_TIME: Final = 48
_ROUNDING: Final = 1e-3  # tolerance of an angle between neighbours: meshes have 6 digits
# An axis of a cylinder with a smaller component along the joint's axis, as a unit vector, is not parallel to it.
_MIN_PARALLEL: Final = 0.995


@dataclass(frozen=True, slots=True)
class Tyre:
    """The round part of a link about a joint's axis."""

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
    tyres, reach, others = list[Tyre](), 0.0, list[NotRound]()
    for shape in link.collisions:
        found = _tyre_of(shape, joint.axis_xyz, joint.anchor_xyz)
        if isinstance(found, Tyre):
            tyres.append(found)
        else:
            others.append(found)
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
    widest = _widest_step(corners)
    if widest > 2 * math.pi / MIN_CORNERS + _ROUNDING:
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


def _widest_step(corners: Sequence[tuple[float, float]]) -> float:
    angles = sorted(math.atan2(y, x) for x, y in corners)
    return max(after - before for before, after in pairwise((*angles, angles[0] + 2 * math.pi)))


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
