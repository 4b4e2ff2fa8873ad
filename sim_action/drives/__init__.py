"""Drives: they convert a twist of the base to targets for its wheel and steering joints."""

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
    """A drive during a run. It keeps the commanded wheel speeds from step to step."""

    @property
    def joints(self) -> frozenset[str]:
        """The joints that the drive controls."""

    @property
    def released(self) -> JointTargets:
        """The targets that end all effects of the drive other than joint motion."""

    def targets(self, twist: Twist, steps: int) -> list[JointTargets]:
        """Return the joint targets of the next physics steps; fewer than `steps` if they stop changing."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on commands that the drive could not follow, each once."""


class Drive(FrozenModel):
    """The base class of all drives: a frozen spec whose fields are the YAML keys."""

    key: ClassVar[str]
    """The name in YAML."""

    @classmethod
    @abstractmethod
    def recognise(cls, model: RobotModel) -> Self | None:
        """Return a drive of this kind if the model appears to have one, else None."""

    @abstractmethod
    def problems(self, model: RobotModel) -> SpecProblems:
        """Yield everything that does not fit the model."""

    @abstractmethod
    def open(self, model: RobotModel, rate: float, gravity: float = GRAVITY) -> DriveMotion:
        """Start the drive for physics steps at `rate` Hz; `gravity` in m/s^2 sets the weight."""

    @abstractmethod
    def wheel_motion(self, model: RobotModel) -> WheelMotion | None:
        """Return the forward kinematics of the wheels; None if there are none."""

    @abstractmethod
    def describe(self, model: RobotModel, gravity: float = GRAVITY) -> str:
        """Return one line of text with all parameters, including those read from the model."""

    @abstractmethod
    def mobility(self, model: RobotModel) -> Mobility:
        """Return the motions that the drive can perform."""

    def prepared(self, scene: Scene) -> Scene:
        """Return the scene with the drive's mobility, and with properties of the drive that the model lacks."""
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

NOT_PLANAR: Final = "a twist had components other than forward speed and turn rate; this drive ignored them"


def is_planar(twist: Twist) -> bool:
    """Return True if a twist has only forward speed and turn rate."""
    return is_level(twist) and twist.linear_xyz[1] == 0


def is_level(twist: Twist) -> bool:
    """Return True if a twist has only a velocity over the ground and a turn rate."""
    return not any((twist.linear_xyz[2], *twist.angular_xyz[:2]))


def recognise(model: RobotModel) -> Drive | None:
    """Return the first drive of the table that fits a model without problems, else None."""
    found: Iterator[Drive | None] = (DRIVES.load(name).recognise(model) for name in DRIVES)
    return next((drive for drive in found if drive is not None and not any(drive.problems(model))), None)
