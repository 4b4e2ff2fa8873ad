"""Wheels of a robot model: their joints, radii and places."""

from __future__ import annotations

from dataclasses import dataclass

from sim_action.geometry import Vector3
from sim_action.kinematics import link_poses
from sim_action.robot_model import RobotModel


@dataclass(frozen=True, slots=True)
class Wheel:
    """A wheel: its joint, its radius in m (None if the model does not tell), its centre in the base frame at home."""

    joint: str
    radius: float | None
    position_xyz: Vector3


def wheel(model: RobotModel, joint_name: str) -> Wheel:
    """The wheel that a joint turns, all joints where they begin; KeyError if the model has no such joint."""
    link = model.joints_by_name[joint_name].child
    place = link_poses(model, model.positions({}))[link]
    return Wheel(joint_name, radius(model, joint_name), place.position_xyz)


def radius(model: RobotModel, joint_name: str) -> float | None:
    """Of the link that a joint turns, in m: that of its first round shape; None if it has none."""
    link = model.links_by_name[model.joints_by_name[joint_name].child]
    return next((shape.radius for shape in link.collisions if shape.radius is not None), None)
