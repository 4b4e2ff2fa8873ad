"""Drives: they convert a twist of the base to targets for its wheel and steering joints."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import ClassVar, Final, Protocol, Self

from pydantic import ValidationError

from sim_action.core.field_types import FrozenModel
from sim_action.core.geometry import Twist
from sim_action.core.records import replace
from sim_action.core.registry import Table
from sim_action.core.yaml_errors import SpecProblems
from sim_action.drives.plugins import (
    Kind,
    NoDrive,
    Stated,
    base_mover,
    plugins_of_kind,
    source_of,
    unread_parameters,
    unusable_plugins,
)
from sim_action.robot.model.kinematics import Mobility, SameModel
from sim_action.robot.model.robot_model import RobotModel
from sim_action.state.command import JointTargets
from sim_action.state.sensor_inputs import WheelMotion
from sim_action.world.physics import GRAVITY
from sim_action.world.scene import Scene


class DriveMotion(Protocol):
    """A drive during a run. It keeps the commanded wheel speeds from step to step."""

    @property
    def joints(self) -> frozenset[str]:
        """The joints that the drive controls."""

    @property
    def released(self) -> JointTargets:
        """The targets that end all effects of the drive other than joint motion."""
        return JointTargets()

    def targets(self, twist: Twist, steps: int) -> list[JointTargets]:
        """Return the joint targets of the next physics steps; fewer than `steps` if they stop changing."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on commands that the drive could not follow, each once."""


class Drive(FrozenModel):
    """The base class of all drives: a frozen spec whose fields are the YAML keys."""

    key: ClassVar[str]  # the name in YAML

    moves_base: ClassVar[bool] = False
    """True if the motion is imposed on the base, so that friction of its wheels does not matter."""

    slips: ClassVar[bool] = False  # True if its wheels slip sideways whenever the robot turns

    @classmethod
    def recognise(cls, model: RobotModel) -> Self | None:
        """Return a drive of this kind if the model states one, or its wheels look like one, else None."""
        try:
            return cls.stated(model) or cls.by_wheels(model)
        except NoDrive:
            return None

    @classmethod
    def stated(cls, model: RobotModel) -> Self | None:
        """Return the drive that a plugin or a controller states, if it fits the model, else None."""
        drive = cls.statement(model)
        return drive if drive is not None and not any(drive.problems(model)) else None

    @classmethod
    @abstractmethod
    def statements(cls, model: RobotModel) -> Stated | None:
        """Return the statements of a plugin or a controller about such a drive, else None."""

    @classmethod
    def statement(cls, model: RobotModel) -> Self | None:
        """Return the drive that a plugin or a controller states, which may not fit the model, else None."""
        stated = cls.statements(model)
        return cls.as_stated(model, stated) if stated else None

    @classmethod
    def as_stated(cls, model: RobotModel, stated: Stated) -> Self | None:  # noqa: ARG003 - some look at the wheels
        """Return the drive that a plugin states; None if it is invalid, for example with three steered wheels."""
        try:
            return cls.model_validate(stated.keys)
        except ValidationError:
            return None

    def origin(self, model: RobotModel) -> Stated | None:
        """Return the statements that this drive was made of, if any."""
        stated = self.statements(model)
        return stated if stated and self == self.as_stated(model, stated) else None

    @classmethod
    @abstractmethod
    def by_wheels(cls, model: RobotModel) -> Self:
        """Return the drive that the wheels of the model look like, which may not fit it. Raises NoDrive."""

    def source(self, model: RobotModel) -> str:
        """Return the statements of the model that this drive was recognised from."""
        from sim_action.drives.undercarriage import undercarriage  # it imports this module

        stated = self.origin(model)
        return stated.source if stated else undercarriage(model).source or "geometry"

    def plugin(self, model: RobotModel) -> str:
        """Return the plugin whose wheels turn as in Gazebo, whatever their axes are; empty without one."""
        return ""

    @abstractmethod
    def problems(self, model: RobotModel) -> SpecProblems:
        """Yield everything that does not fit the model."""

    @abstractmethod
    def open(self, model: RobotModel, rate: float, gravity: float = GRAVITY) -> DriveMotion:
        """Start the drive for physics steps at `rate` Hz; `gravity` in m/s^2 sets the weight."""

    @abstractmethod
    def wheel_motion(self, model: RobotModel) -> WheelMotion | None:
        """Return the forward kinematics of the wheels; None if there are none."""

    def describe(self, model: RobotModel, gravity: float = GRAVITY) -> str:
        """Return one line of text with all parameters, including those read from the model, and remarks on a plugin."""
        return "; ".join((self.figures(model, gravity), *self.remarks(model)))

    def remarks(self, model: RobotModel) -> tuple[str, ...]:
        """Return remarks on the plugin that states the drive."""
        stated = self.origin(model)
        return stated.remarks if stated else ()

    @abstractmethod
    def figures(self, model: RobotModel, gravity: float) -> str:
        """Return all parameters as text."""

    @abstractmethod
    def mobility(self, model: RobotModel) -> Mobility:
        """Return the motions that the drive can perform."""

    def prepared(self, scene: Scene) -> Scene:
        """Return the scene with the drive's mobility, and with properties of the drive that the model lacks."""
        mobility, wheels = self.mobility(scene.model), self.wheel_motion(scene.model)
        gears = {} if wheels is None else wheels.gears
        limits = ((gear, scene.model.joints_by_name[name].max_velocity) for name, gear in gears.items())
        fastest = max((abs(gear) * limit if limit else math.inf for gear, limit in limits), default=math.inf)
        return replace(scene, mobility=replace(mobility, fastest=fastest))


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


# Kind of drive -> kinds of the plugins that state it. A differential drive with several wheels per side is skid steer.
_STATED_BY: Final[Mapping[str, tuple[Kind, ...]]] = {
    "diff": ("diff",),
    "mecanum": ("mecanum",),
    "skid": ("skid", "diff"),
    "ackermann": ("ackermann",),
}


def recognise(model: RobotModel) -> Drive | None:
    """Return the drive that a plugin or a controller states, else the one that the wheels look like, else None."""
    return _recognised(SameModel(model))


# The checks and the run of each variation ask for it, and up to 10,000 variations share one model.
@lru_cache(maxsize=4)
def _recognised(same: SameModel) -> Drive | None:
    model = same.model
    claimed = [name for name in DRIVES if plugins_of_kind(model, *_STATED_BY[name])]
    for name in claimed:
        if (stated := DRIVES.load(name).stated(model)) is not None:
            return stated
    # A plugin rules other kinds out, also if it does not fit. Without wheels of its own, all of them.
    likely = claimed or (DRIVES if base_mover(model) is None else ())
    found = (_by_wheels(DRIVES.load(name), model) for name in likely)
    return next((drive for drive in found if not isinstance(drive, str)), None)


def _by_wheels(kind: type[Drive], model: RobotModel) -> Drive | str:
    """Return the drive that the wheels look like, if it fits the model, else the reason why there is none."""
    try:
        drive = kind.by_wheels(model)
    except NoDrive as reason:
        return str(reason)
    return next((message for _, message in drive.problems(model)), drive)


def why_not_recognised(model: RobotModel) -> tuple[str, ...]:
    """Return the reasons why no drive is recognised, most likely first: of the plugins, then of each kind of drive."""
    from sim_action.drives.undercarriage import undercarriage  # it imports this module

    stated = [drive for name in DRIVES if (drive := DRIVES.load(name).statement(model)) is not None]
    unfit = {drive.source(model): message for drive in reversed(stated) for message in _unfit(drive, model)}
    reasons = [f"{source} does not fit: {message}" for source, message in unfit.items()]
    reasons += [*(() if unfit else unusable_plugins(model)), *unread_parameters(model)]
    if (mover := base_mover(model)) is not None:
        reasons.append(f"{source_of(mover)} moves the base itself, without wheels: no drive of sim-action does that")
    found = undercarriage(model)
    likely = "ackermann" if found.steered else "skid" if len(found.driven) > _MAX_DIFF_WHEELS else "diff"
    kinds = sorted(DRIVES, key=lambda name: name != likely)
    found_by_kind = {name: _by_wheels(DRIVES.load(name), model) for name in kinds}
    return (*reasons, *(f"{name}: {reason}" for name, reason in found_by_kind.items() if isinstance(reason, str)))


def _unfit(drive: Drive, model: RobotModel) -> Iterator[str]:
    messages = [message for _, message in drive.problems(model)]
    yield from messages[::-1] or ["its wheels roll along the line between the sides"]


_MAX_DIFF_WHEELS: Final = 3  # more wheels cannot belong to a differential drive
