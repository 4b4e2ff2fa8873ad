"""Drives: from a twist of the base to targets for the joints that move it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, Final, Protocol, Self

from sim_action.core.field_types import FrozenModel
from sim_action.core.geometry import Twist
from sim_action.core.registry import Table
from sim_action.core.yaml_errors import SpecProblems
from sim_action.robot.kinematics import Mobility
from sim_action.robot.robot_model import RobotModel
from sim_action.state.command import JointTargets
from sim_action.world.physics import GRAVITY
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.sensor_inputs import WheelMotion


class DriveMotion(Protocol):
    """The live half of a drive: remembers how fast the wheels were told to turn."""

    @property
    def joints(self) -> frozenset[str]:
        """The joints that it moves."""

    @property
    def released(self) -> JointTargets:
        """What ends all that it does beside turning its joints."""

    def targets(self, twist: Twist, steps: int) -> list[JointTargets]:
        """Joint targets for the next physics steps; fewer than `steps` once they no longer change."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What it was asked for so far and could not do, for people; each thing once."""


class Drive(FrozenModel):
    """What all drives are: a frozen spec whose fields are the YAML keys."""

    key: ClassVar[str]
    """Its name in YAML."""

    @classmethod
    @abstractmethod
    def recognise(cls, model: RobotModel) -> Self | None:
        """A drive of this kind for a model that looks as if it had one."""

    @abstractmethod
    def problems(self, model: RobotModel) -> SpecProblems:
        """What does not fit the model."""

    @abstractmethod
    def open(self, model: RobotModel, rate: float, gravity: float = GRAVITY) -> DriveMotion:
        """The live half, for physics steps at `rate` Hz and a weight of mass times `gravity` m/s^2."""

    @abstractmethod
    def wheel_motion(self, model: RobotModel) -> WheelMotion | None:
        """How its wheels move the robot; None: it has none."""

    @abstractmethod
    def describe(self, model: RobotModel, gravity: float = GRAVITY) -> str:
        """One line for people, with every figure that was read from the model."""

    @abstractmethod
    def mobility(self, model: RobotModel) -> Mobility:
        """What it can do."""

    def prepared(self, scene: Scene) -> Scene:
        """The scene with what the drive can do, and with what it is known to have and the model does not tell."""
        return replace(scene, mobility=self.mobility(scene.model))


DRIVES: Final = Table[type[Drive]](
    "drive",
    {
        "diff": "sim_action.drives.diff:DiffDrive",
        "mecanum": "sim_action.drives.mecanum:MecanumDrive",
        "skid": "sim_action.drives.skid:SkidSteer",
        "ackermann": "sim_action.drives.ackermann:AckermannDrive",
    },
)

NOT_PLANAR: Final = (
    "a twist asked for more than forward speed and turning rate; this drive cannot do the rest, and left it out"
)


def is_planar(twist: Twist) -> bool:
    """Whether a twist is forward speed and turning rate alone."""
    return is_level(twist) and twist.linear_xyz[1] == 0


def is_level(twist: Twist) -> bool:
    """Whether a twist is a velocity over the ground and turning rate alone."""
    return not any((twist.linear_xyz[2], *twist.angular_xyz[:2]))


def recognise(model: RobotModel) -> Drive | None:
    """The first drive of the table that fits a model, without a problem in it."""
    found: Iterator[Drive | None] = (DRIVES.load(name).recognise(model) for name in DRIVES)
    return next((drive for drive in found if drive is not None and not any(drive.problems(model))), None)
