"""Upper bounds on how far any point of a body or robot has moved, cheap enough for every step."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from sim_action.core import geometry
from sim_action.core.geometry import Vector3
from sim_action.core.lazy_numpy import FloatArray
from sim_action.robot.model.robot_model import Joint, RobotModel, Shape

# Factor that covers rounding errors, and how far beyond its limits a prismatic joint may be pushed.
_ROUNDING = 1 + 1e-9
_BEYOND_LIMITS = 1.1


class BodyMotionBound:
    """An upper bound in m on how far any point of a rigid body has moved.

    A pose that changes by dp and by dq (of its unit quaternion) moves a point at a distance r by no more than
    |dp| + 2 r |dq|.
    """

    def __init__(self, radius: float) -> None:
        """`radius`: greatest distance of its points from its origin in m; inf if unknown."""
        self._diameter = 2 * radius
        self._last: Sequence[float] = ()

    def advance(self, pose: Sequence[float]) -> float:
        """Return the bound for a step that ends at `pose` (7,): position and unit quaternion."""
        last, self._last = self._last or pose, pose
        turned = math.dist(pose[3:], last[3:])
        # 0 times infinity would be NaN.
        return (math.dist(pose[:3], last[:3]) + (self._diameter * turned if turned else 0.0)) * _ROUNDING

    def advance_all(self, poses: FloatArray) -> FloatArray:
        """Return the bounds (T,) in m for T steps, (T, 7)."""
        change = np.diff(np.vstack((self._last or poses[0], poses)), axis=0) ** 2
        self._last = tuple(poses[-1].tolist())
        moved, turned = np.sqrt(change[:, :3].sum(axis=1)), np.sqrt(change[:, 3:].sum(axis=1))
        bounds: FloatArray = (moved + _times(turned, self._diameter)) * _ROUNDING
        return bounds


class RobotMotionBound:
    """An upper bound in m on the motion of any point of a robot: of the base, plus each joint's angle times reach."""

    def __init__(self, model: RobotModel, radii: Mapping[str, float]) -> None:
        """`radii`: link -> greatest distance of its shapes from its origin in m; inf if unknown."""
        extents = _extents(model, radii)
        self._base = BodyMotionBound(extents[model.root])
        self._chains = _chains(model, extents)
        self._last: Sequence[float] = ()

    def advance(self, pose: Sequence[float], joints: Sequence[float]) -> float:
        """Return the bound for a step that ends at `pose` (7,) of the base and at joint positions (J,)."""
        last, self._last = self._last or joints, joints
        moved = 0.0
        for chain in self._chains:
            swung = 0.0
            for joint, reach in chain:
                turned = abs(joints[joint] - last[joint])
                swung += reach * turned if turned else 0.0
            moved = max(moved, swung)
        return (moved + self._base.advance(pose)) * _ROUNDING

    def advance_all(self, poses: FloatArray, joints: FloatArray) -> FloatArray:
        """Return the bounds (T,) in m for T steps, (T, 7) and (T, J)."""
        turned = np.abs(np.diff(np.vstack((self._last or joints[0], joints)), axis=0))
        self._last = tuple(joints[-1].tolist())
        moved = np.zeros(len(joints))
        for chain in self._chains:
            moved = np.maximum(moved, sum(_times(turned[:, joint], reach) for joint, reach in chain))
        return (moved + self._base.advance_all(poses)) * _ROUNDING


def _times(turned: FloatArray, reach: float) -> FloatArray:
    return turned * reach if reach < math.inf else np.where(turned == 0.0, 0.0, math.inf)


def _extents(model: RobotModel, radii: Mapping[str, float]) -> dict[str, float]:
    """Return link -> greatest distance in m of its own shapes and of its descendants from its origin."""
    extents: dict[str, float] = {}
    for name in reversed(_from_root(model)):
        ways = (
            math.hypot(*joint.origin.position_xyz) + _stroke(joint) + extents[joint.child]
            for joint in model.joints
            if joint.parent == name
        )
        extents[name] = max([radii.get(name, 0.0), *ways])
    return extents


def _from_root(model: RobotModel) -> list[str]:
    names = [model.root]
    for name in names:
        names += [joint.child for joint in model.joints if joint.parent == name]
    return names


def _stroke(joint: Joint) -> float:
    if joint.type != "prismatic":
        return 0.0
    if joint.lower is None or joint.upper is None:
        return math.inf
    return _BEYOND_LIMITS * max(abs(joint.lower), abs(joint.upper))


def _reach(model: RobotModel, joint: Joint, extent: float) -> float:
    """Return by how many m a joint moves the links beyond it, per rad or m."""
    if joint.type == "prismatic":
        return 1.0
    shapes = model.links_by_name[joint.child].collisions
    if not shapes or any(other.parent == joint.child for other in model.joints):
        return extent
    return min(extent, max(swing_per_turn(shape, joint.axis_xyz) for shape in shapes))


def swing_per_turn(shape: Shape, axis_xyz: Vector3) -> float:
    """Return by how many m per rad a shape's surface moves when it turns about an axis; 0 if it is round about it."""
    if shape.kind not in ("cylinder", "sphere"):
        return math.inf
    place, size = shape.pose.position_xyz, math.hypot(*shape.upper_xyz)
    upright = geometry.rotate(shape.pose.orientation_xyzw, (0.0, 0.0, 1.0))
    tilt = math.hypot(*geometry.cross(upright, axis_xyz)) if shape.kind == "cylinder" else 0.0
    # An axis that changes by dz turns by no more than 2 |dz|.
    return math.hypot(*geometry.cross(place, axis_xyz)) + 2 * tilt * size


def _chains(model: RobotModel, extents: Mapping[str, float]) -> list[list[tuple[int, float]]]:
    """Return for each leaf the joints that move it, each with the reach in m per rad or m."""
    numbers = {joint.name: number for number, joint in enumerate(model.moving_joints)}
    chains: dict[str, list[tuple[int, float]]] = {model.root: []}
    inner = set()
    for name in _from_root(model):
        for joint in (joint for joint in model.joints if joint.parent == name):
            reach = _reach(model, joint, extents[joint.child])
            moves = [(numbers[joint.name], reach)] if joint.name in numbers else []
            chains[joint.child] = chains[name] + moves
            inner.add(name)
    return [chain for name, chain in chains.items() if chain and name not in inner]


# A surface that moves less per rad of its own joint is round about it.
_ROUND_M = 1e-6
_FAR_M = 1e6


class MotionFactors(NamedTuple):
    """The factors (2 + J,) of the base's speed and turn rate and of the joint speeds."""

    ways: FloatArray  # their product with these is an upper bound in m/s on the speed of any point of a link
    turns: FloatArray  # the same in rad/s on its turn rate. The spin of a round link about its axis does not count.


def motion_factors(model: RobotModel, reaches: Mapping[str, float]) -> dict[str, MotionFactors]:
    """Return the factors of each link; `reaches`: link -> greatest distance in m of its shapes from its frame."""
    numbers = {joint.name: number for number, joint in enumerate(model.moving_joints)}
    above = {joint.child: joint for joint in model.joints}
    found = {}
    for link, least in reaches.items():
        ways, turns, name, reach = np.zeros(2 + len(numbers)), np.zeros(2 + len(numbers)), link, least
        while name in above:
            joint = above[name]
            anchor = math.hypot(*joint.anchor_xyz)
            if joint.name in numbers:
                column = 2 + numbers[joint.name]
                ways[column] = 1.0 if joint.type == "prismatic" else reach + anchor
                turns[column] = 0.0 if joint.type == "prismatic" else 1.0
                if name == link and joint.type != "prismatic" and not anchor:
                    swings = [swing_per_turn(shape, joint.axis_xyz) for shape in model.links_by_name[link].collisions]
                    ways[column] = min(reach, max(swings, default=reach))
                    turns[column] = float(ways[column] > _ROUND_M)
            reach += math.hypot(*joint.origin.position_xyz) + 2 * anchor + _stroke(joint)
            name = joint.parent
        ways[0], ways[1], turns[1] = 1.0, reach, 1.0
        # The product of infinity and 0 would be NaN.
        found[link] = MotionFactors(np.minimum(ways, _FAR_M), turns)
    return found
