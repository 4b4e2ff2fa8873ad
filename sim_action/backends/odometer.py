"""How far any point of a robot can have come, as a bound that is cheap to work out at every step."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from sim_action.robot_model import Joint, RobotModel

# What rounding makes of a bound, and how much further than its limits a slide may be pushed.
_ROUNDING = 1 + 1e-9
_BEYOND_LIMITS = 1.1
_FAR = 1e9


class PoseOdometer:
    """Adds up how far any point of a rigid body can have come, in m.

    A pose that changes by dp and by dq (of its unit quaternion) moves a point at a distance r by no more than
    |dp| + 2 r |dq|.
    """

    def __init__(self, radius: float) -> None:
        """`radius`: m, how far its points are from its origin at most; inf if nobody knows."""
        self._diameter = 2 * radius
        self._last: Sequence[float] = ()
        self.way = 0.0

    def advance(self, pose: Sequence[float]) -> float:
        """Adds a step, which ends at a pose (7,): position and unit quaternion; returns what it adds."""
        last, self._last = self._last or pose, pose
        turned = math.dist(pose[3:], last[3:])
        # Nothing times infinity is not a number.
        moved = math.dist(pose[:3], last[:3]) + (self._diameter * turned if turned else 0.0)
        self.way += moved * _ROUNDING
        return moved


class Odometer:
    """Adds up how far any point of a robot can have come, in m.

    Beside what the base does, a joint moves what is beyond it by no more than its angle times how far away that can be.
    """

    def __init__(self, model: RobotModel, radii: Mapping[str, float]) -> None:
        """`radii`: link -> m, how far its shapes are from its origin at most; inf if nobody knows."""
        extents = _extents(model, radii)
        self._base = PoseOdometer(extents[model.root])
        self._chains = _chains(model, extents)
        self._last: Sequence[float] = ()
        self.way = 0.0

    def advance(self, pose: Sequence[float], joints: Sequence[float]) -> float:
        """Adds a step, which ends at a pose (7,) of the base, and at joint positions (J,); returns what it adds."""
        last, self._last = self._last or joints, joints
        moved = 0.0
        for chain in self._chains:
            swung = 0.0
            for joint, reach in chain:
                swung += reach * abs(joints[joint] - last[joint])
            # Also where it is no number.
            moved = max(moved, swung)
        moved = (moved + self._base.advance(pose)) * _ROUNDING
        self.way += moved
        return moved


def _extents(model: RobotModel, radii: Mapping[str, float]) -> dict[str, float]:
    """Link -> m: how far what hangs on it, and itself, can be from its origin."""
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


def _chains(model: RobotModel, extents: Mapping[str, float]) -> list[list[tuple[int, float]]]:
    """From the root to each leaf: which joints move it, and by how many m per rad or m."""
    numbers = {joint.name: number for number, joint in enumerate(model.moving_joints)}
    chains: dict[str, list[tuple[int, float]]] = {model.root: []}
    inner = set()
    for name in _from_root(model):
        for joint in (joint for joint in model.joints if joint.parent == name):
            reach = 1.0 if joint.type == "prismatic" else extents[joint.child]
            # Nothing times infinity is not a number; 1e9 m is as far.
            moves = [(numbers[joint.name], min(reach, _FAR))] if joint.name in numbers else []
            chains[joint.child] = chains[name] + moves
            inner.add(name)
    return [chain for name, chain in chains.items() if chain and name not in inner]
