"""Wheels of a robot model: their joints, radii, places and axles, and which of them are on the ground."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Final

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Vector3
from sim_action.core.yaml_errors import SpecProblems
from sim_action.robot.kinematics import link_poses, robot_box
from sim_action.robot.robot_model import Joint, RobotModel, Shape

ASKEW: Final = 0.1
"""Of a unit vector: how far an axle may be off the direction that makes it plain."""

# Of its radius: how far above the lowest shape a wheel may end that is on the ground.
_LIFTED: Final = 0.1

# Of a unit vector: from here on, an axle is not level, or does not lie across the heading.
_NO_AXLE: Final = 0.5
_ROUNDING: Final = 1e-9


@dataclass(frozen=True, slots=True)
class Wheel:
    """A wheel, with all joints where they begin.

    Attributes:
        joint: the joint that turns it.
        radius: m; None if the model does not tell.
        position_xyz: m, base frame: the middle of its round shape, or of its link if it has none.
        axis_xyz: unit vector, base frame: about which the joint turns it.
    """

    joint: str
    radius: float | None
    position_xyz: Vector3
    axis_xyz: Vector3


def wheel(model: RobotModel, joint_name: str) -> Wheel:
    """The wheel that a joint turns; KeyError if the model has no such joint."""
    return _wheel_at_home(_Same(model), joint_name)


def radius(model: RobotModel, joint_name: str) -> float | None:
    """Of the link that a joint turns, in m: that of its first round shape; None if it has none."""
    tyre = _tyre(model, model.joints_by_name[joint_name])
    return tyre.radius if tyre else None


def wheels_on_ground(model: RobotModel) -> tuple[Wheel, ...]:
    """Round links that joints turn freely about a level axis, as low as anything of the robot is."""
    poses = _poses(model)
    box = robot_box(model, poses)
    return tuple(_on_ground(model, poses, box[0][2])) if box else ()


def steering_joint(model: RobotModel, joint_name: str) -> Joint | None:
    """The nearest joint that moves above that of a wheel; None if it hangs on nothing that moves."""
    above = {joint.child: joint for joint in model.joints}
    link = model.joints_by_name[joint_name].parent
    while link in above:
        if above[link].moves:
            return above[link]
        link = above[link].parent
    return None


def centre_of_mass(model: RobotModel) -> Vector3:
    """Of all links that state a mass, in m, base frame, with all joints where they begin."""
    poses = _poses(model)
    x = y = z = 0.0
    for link in model.links:
        at = geometry.compose(poses[link.name], Pose(link.centre_of_mass_xyz)).position_xyz
        share = (link.mass or 0.0) / model.mass if model.mass else 0.0
        x, y, z = x + share * at[0], y + share * at[1], z + share * at[2]
    return x, y, z


@dataclass(frozen=True, slots=True, eq=False)
class _Same:
    """A model, compared by what it is and not by what it says, which would take longer than to look anew."""

    model: RobotModel

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and other.model is self.model

    def __hash__(self) -> int:
        return id(self.model)


def _poses(model: RobotModel) -> Mapping[str, Pose]:
    """Link name -> its pose in the base frame, with all joints where they begin."""
    return _poses_at_home(_Same(model))


# A drive asks dozens of times, and 10,000 variations have one model.
@lru_cache(maxsize=4)
def _poses_at_home(same: _Same) -> Mapping[str, Pose]:
    return MappingProxyType(link_poses(same.model, same.model.positions({})))


@lru_cache(maxsize=64)
def _wheel_at_home(same: _Same, joint_name: str) -> Wheel:
    return _wheel(same.model, same.model.joints_by_name[joint_name], _poses(same.model))


def _tyre(model: RobotModel, joint: Joint) -> Shape | None:
    shapes = model.links_by_name[joint.child].collisions
    return next((shape for shape in shapes if shape.radius is not None), None)


def _wheel(model: RobotModel, joint: Joint, poses: Mapping[str, Pose]) -> Wheel:
    pose, tyre = poses[joint.child], _tyre(model, joint)
    middle = geometry.compose(pose, tyre.pose) if tyre else pose
    axis = geometry.rotate(pose.orientation_xyzw, joint.axis_xyz)
    return Wheel(joint.name, tyre.radius if tyre else None, middle.position_xyz, axis)


def _on_ground(model: RobotModel, poses: Mapping[str, Pose], ground: float) -> Iterator[Wheel]:
    """`ground`: m, base frame: the z of what is lowest."""
    for joint in model.joints:
        found = _wheel(model, joint, poses)
        if joint.type != "continuous" or found.radius is None or abs(found.axis_xyz[2]) > ASKEW:
            continue
        if found.position_xyz[2] - found.radius < ground + _LIFTED * found.radius:
            yield found


@dataclass(frozen=True, slots=True)
class Rolling:
    """A wheel as its drive sees it.

    Attributes:
        joint: the joint that turns it.
        ahead, left: m, of the base's origin.
        turns: 1 if it rolls forward when its joint turns forward, -1 if its axis points the other way.
    """

    joint: str
    ahead: float
    left: float
    turns: float


def heading_of(wheels: Sequence[Wheel], left: Sequence[Wheel] = (), right: Sequence[Wheel] = ()) -> float:
    """Which way wheels roll, in rad from the base's x axis: with `left` on their left, or else the nearer to x."""
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
    """Which way wheels roll while all their joints turn forward, in rad as `heading_of`; None if against each other."""
    x = sum(wheel.axis_xyz[1] for wheel in wheels)
    y = -sum(wheel.axis_xyz[0] for wheel in wheels)
    # Rounded, as it is told to be pasted.
    return round(math.atan2(y, x), 9) + 0.0 if math.hypot(x, y) > _NO_AXLE * len(wheels) else None


def rolling(wheel: Wheel, heading: float) -> Rolling:
    """A wheel, seen in the direction in which its drive goes."""
    cosine, sine = math.cos(heading), math.sin(heading)
    x, y, _ = wheel.position_xyz
    turns = math.copysign(1.0, _rolls_along(wheel, heading))
    return Rolling(wheel.joint, cosine * x + sine * y, cosine * y - sine * x, turns)


def along(heading: float, ahead: float, left: float) -> tuple[float, float]:
    """What is so far ahead and to the left, along the axes of the base."""
    cosine, sine = math.cos(heading), math.sin(heading)
    return cosine * ahead - sine * left, sine * ahead + cosine * left


def axle_problems(wheel: Wheel, heading: float) -> SpecProblems:
    """A joint that would not roll a wheel forward."""
    if abs(wheel.axis_xyz[2]) > _NO_AXLE:
        yield (), f"joint '{wheel.joint}' turns about an upright axis in the model: it rolls nothing"
    elif abs(_rolls_along(wheel, heading)) < _NO_AXLE:
        yield (), f"the wheel at '{wheel.joint}' rolls across the others; 'heading' says where forward is"


def _rolls_along(wheel: Wheel, heading: float) -> float:
    x, y, _ = wheel.axis_xyz
    # A wheel that turns about y rolls along x.
    return math.cos(heading) * y - math.sin(heading) * x


def _along_axles(wheels: Sequence[Wheel]) -> tuple[float, float]:
    """The sum of the directions in which wheels roll, all turned the way of the first."""
    first_x, first_y = wheels[0].axis_xyz[1], -wheels[0].axis_xyz[0]
    total_x = total_y = 0.0
    for wheel in wheels:
        x, y = wheel.axis_xyz[1], -wheel.axis_xyz[0]
        way = math.copysign(1.0, x * first_x + y * first_y)
        total_x, total_y = total_x + way * x, total_y + way * y
    return total_x, total_y


def _lateral(x: float, y: float, wheels: Sequence[Wheel]) -> float:
    """How far left of the direction (x, y) wheels are in the mean, in m."""
    return sum(x * wheel.position_xyz[1] - y * wheel.position_xyz[0] for wheel in wheels) / len(wheels)
