"""Move bodies and apply forces between two steps: the protocol that engines implement, and the forces of commands."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, NamedTuple, Protocol

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Quaternion, Twist, Vector3
from sim_action.core.records import dataclass
from sim_action.robot.model.kinematics import link_of_frame
from sim_action.robot.model.robot_model import RobotModel
from sim_action.state.command import WORLD_FRAME, BasePush, LinkWrench

MAX_ATTRACTION_M: Final = 0.001  # shapes that are farther apart do not attract each other


class Target(NamedTuple):
    """The name of a link of the robot or of a body of the world."""

    name: str
    is_link: bool


class BodyControl(Protocol):
    """Access to the bodies of a scene between two steps."""

    def pose(self, body: str) -> Pose:
        """Return the pose of a body's centre, world frame."""

    def set_pose(self, body: str, pose: Pose, twist: Twist) -> None:
        """Set pose and twist of a body; without a mass, the twist acts only on what touches it in the next step."""

    def apply_force(self, target: Target, force_xyz: Vector3, torque_xyz: Vector3, point_xyz: Vector3 | None) -> None:
        """Add a force in N and a torque in N m, world frame, for the next step.

        `point_xyz`: where the force acts, in m, in the frame of the target; None: its centre of mass.
        """

    def attract(self, target: Target, force: float) -> None:
        """Pull a target and each thing that touches it together for the next step, with a force in N per pair."""

    def clear_forces(self) -> None:
        """Remove all forces and torques; called after a step."""

    def add_mass(self, link: str, mass: float) -> None:
        """Add a mass in kg to a link at its centre of mass, for good; a negative one is taken from it."""

    def scale_friction(self, patch: int, factor: float) -> None:
        """Multiply the friction of the patch of the ground with this index."""

    def add_velocity(self, target: Target, velocity_xyz: Vector3) -> None:
        """Add a velocity in m/s, world frame, to a body; to the whole robot if the target is its base link."""


class HeldWrenches:
    """The wrenches of controllers on links, which act at every step until others replace them."""

    def __init__(self, control: BodyControl, link_pose: Callable[[str], Pose], model: RobotModel) -> None:
        """`link_pose`: returns the present pose of a link."""
        self._control, self._link_pose, self._model = control, link_pose, model
        self.held: tuple[LinkWrench, ...] = ()

    def apply(self) -> None:
        """Add all wrenches for the next step, turned into the world frame by the present poses."""
        turns: dict[str, Quaternion] = {WORLD_FRAME: geometry.IDENTITY}
        for wrench in self.held:
            if wrench.frame not in turns:
                turns[wrench.frame] = self._link_pose(link_of_frame(self._model, wrench.frame)).orientation_xyzw
            turn = turns[wrench.frame]
            force, torque = geometry.rotate(turn, wrench.force_xyz), geometry.rotate(turn, wrench.torque_xyz)
            self._control.apply_force(Target(wrench.link, is_link=True), force, torque, wrench.point_xyz)


@dataclass(frozen=True, slots=True)
class RobotInertia:
    """The mass and the yaw inertia of a whole robot."""

    mass: float  # kg
    # lower bound in kg m^2 about the vertical axis through the base. A servo with too small an inertia still reaches
    # its velocity and does not oscillate.
    inertia: float


@dataclass(frozen=True, slots=True)
class Wrench:
    """A force in N at a point in m, and a torque in N m; world frame."""

    force_xyz: Vector3
    point_xyz: Vector3
    torque_xyz: Vector3


def base_wrench(push: BasePush, robot: RobotInertia, pose: Pose, twist: Twist, time_step: float) -> Wrench:
    """Return the wrench that brings the base, at `pose` with `twist`, to its target velocity, within its limits."""
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
