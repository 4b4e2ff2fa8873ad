"""What an engine offers to those that move bodies and push the robot while a scene runs."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from sim_action.core.geometry import Pose, Twist, Vector3


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
