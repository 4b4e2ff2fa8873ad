"""Wheels of a robot model: their joints, radii and places."""

from __future__ import annotations

from dataclasses import dataclass

from sim_action import geometry
from sim_action.geometry import Pose, Vector3
from sim_action.robot_model import RobotModel


@dataclass(frozen=True, slots=True)
class Wheel:
    """A wheel: its joint, its radius in m (None if the model does not tell), its centre in the base frame."""

    joint: str
    radius: float | None
    position_xyz: Vector3


def wheel(model: RobotModel, joint_name: str) -> Wheel:
    """The wheel that a joint turns; KeyError if the model has no such joint."""
    link = model.links_by_name[model.joints_by_name[joint_name].child]
    radius = next((shape.radius for shape in link.collisions if shape.radius is not None), None)
    return Wheel(joint_name, radius, link_pose(model, link.name).position_xyz)


def link_pose(model: RobotModel, link: str) -> Pose:
    """The pose of a link in the base frame, with all joints at zero."""
    pose = Pose()
    parents = {joint.child: joint for joint in model.joints}
    while link in parents:
        pose = geometry.compose(parents[link].origin, pose)
        link = parents[link].parent
    return pose
