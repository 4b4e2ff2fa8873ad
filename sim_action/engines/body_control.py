"""What an engine offers to those that move bodies and push the robot while a scene runs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist, Vector3
from sim_action.state.command import BasePush


class Target(NamedTuple):
    """A link of the robot, or else a body of the world."""

    name: str
    is_link: bool


class Stage(Protocol):
    """An engine with a scene in it, between two steps."""

    def pose(self, body: str) -> Pose:
        """Of the middle of a body of the world."""

    def put(self, body: str, pose: Pose, twist: Twist) -> None:
        """Sets where a body of the world is, and how it moves: one without a mass, for what touches it in a step."""

    def press(self, target: Target, force_xyz: Vector3, torque_xyz: Vector3, point_xyz: Vector3 | None) -> None:
        """Adds a force in N and a torque in N m, world frame, for the next step.

        `point_xyz`: m, where the force acts, in the frame of the target; None: at its centre of mass.
        """

    def release(self) -> None:
        """Takes back all forces and torques; after a step."""

    def push(self, target: Target, velocity_xyz: Vector3) -> None:
        """Adds a velocity in m/s, world frame, to all of a body, or of the robot if the target is its base link."""


@dataclass(frozen=True, slots=True)
class Pushed:
    """A robot as a whole.

    Attributes:
        mass: kg.
        inertia: kg m^2 about the upright through the base, at the least: a servo that takes a robot for lighter than it
            is comes to its velocity all the same, and does not swing.
    """

    mass: float
    inertia: float


@dataclass(frozen=True, slots=True)
class Wrench:
    """A force in N at a point in m, and a torque in N m; all in the world frame."""

    force_xyz: Vector3
    point_xyz: Vector3
    torque_xyz: Vector3


def wrench(push: BasePush, robot: Pushed, pose: Pose, twist: Twist, time_step: float) -> Wrench:
    """What brings the base to its velocity within the next step, or as much of it as is allowed.

    `pose`, `twist`: of the base link's origin, world frame.
    """
    yaw = pose.yaw
    (ahead, left), (has_x, has_y, _) = push.linear_xy, twist.linear_xyz
    x, y = math.cos(yaw) * ahead - math.sin(yaw) * left, math.sin(yaw) * ahead + math.cos(yaw) * left
    needed = robot.mass * (x - has_x) / time_step, robot.mass * (y - has_y) / time_step
    part = min(1.0, push.max_force / (math.hypot(*needed) or 1.0))
    torque = robot.inertia * (push.angular_z - twist.angular_xyz[2]) / time_step
    return Wrench(
        force_xyz=(part * needed[0], part * needed[1], 0.0),
        point_xyz=geometry.compose(pose, Pose(push.point_xyz)).position_xyz,
        torque_xyz=(0.0, 0.0, max(-push.max_torque, min(push.max_torque, torque))),
    )
