"""Drives: they convert a twist of the base to targets for its wheel and steering joints; and keys that they share."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Annotated, ClassVar, Final, Protocol, Self

from pydantic import Field, ValidationError

from sim_action.core import units
from sim_action.core.field_types import FrozenModel, PositiveMetres, PositiveNewtonMetres, Radians
from sim_action.core.geometry import Twist
from sim_action.core.records import replace
from sim_action.core.registry import Table
from sim_action.core.yaml_document import SpecProblems
from sim_action.drives.plugins import (
    Kind,
    NoDrive,
    Stated,
    plugins_of_kind,
    source_of,
    unread_parameters,
    unusable_plugins,
)
from sim_action.robot.model.kinematics import Mobility, SameModel
from sim_action.robot.model.robot_model import RobotModel
from sim_action.state.command import JointTargets
from sim_action.state.readings import WheelMotion
from sim_action.world.physics import GRAVITY
from sim_action.world.scene import Scene

MAX_STATED_DEVIATION: Final = 0.05  # a stated length that differs more than this share from the geometry is noted


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
        """Return the plugin whose wheels turn as in Gazebo regardless of their axes; empty without one."""
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
        """Return remarks on the plugin that states the drive, and on lengths that differ from the model."""
        stated = self.origin(model)
        return (*stated.remarks, *self._deviations(model)) if stated else ()

    def _deviations(self, model: RobotModel) -> Iterator[str]:
        for key, length in self.lengths(model).items():
            value = getattr(self, key)
            if value and length and self.is_far(key, value / length):
                title = "wheel radius" if key == "radius" else key
                yield f"the plugin's {title} differs from that of the wheels in the model, {length:.4g} m"

    def lengths(self, model: RobotModel) -> Mapping[str, float]:
        """Return the lengths of the wheels in the model, in m, by key of the drive; unknown ones are 0 or left out."""
        return {}

    def is_far(self, key: str, ratio: float) -> bool:
        """Return True if a stated length, as a ratio to the model's, deserves a remark."""
        return abs(ratio - 1) > MAX_STATED_DEVIATION

    @abstractmethod
    def figures(self, model: RobotModel, gravity: float) -> str:
        """Return all parameters as text."""

    @abstractmethod
    def mobility(self, model: RobotModel) -> Mobility:
        """Return the motions that the drive can perform."""

    def prepared(self, scene: Scene) -> Scene:
        """Return the scene with the drive's mobility, and with properties of the drive that the model lacks."""
        mobility = self.mobility(scene.model)
        wheels = self.wheel_motion(scene.model)
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
    likely = claimed or (() if plugins_of_kind(model, "mover") else DRIVES)
    attempts = (_by_wheels(DRIVES.load(name), model) for name in likely)
    return next((drive for drive in attempts if not isinstance(drive, str)), None)


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
    for mover in plugins_of_kind(model, "mover")[:1]:
        remedy = "state the drive of the real robot, such as mecanum"
        reasons.append(f"{source_of(mover)} moves the base itself, without wheels: {remedy}")
    for tracks in plugins_of_kind(model, "tracks")[:1]:
        remedy = "put wheels in their place, or push the base with 'wrench'"
        reasons.append(f"{source_of(tracks)} moves tracks, which are not simulated: {remedy}")
    chassis = undercarriage(model)
    likely = "ackermann" if chassis.steered else "skid" if len(chassis.driven) > _MAX_DIFF_WHEELS else "diff"
    kinds = sorted(DRIVES, key=lambda name: name != likely)
    found_by_kind = {name: _by_wheels(DRIVES.load(name), model) for name in kinds}
    return (*reasons, *(f"{name}: {reason}" for name, reason in found_by_kind.items() if isinstance(reason, str)))


def _unfit(drive: Drive, model: RobotModel) -> Iterator[str]:
    messages = [message for _, message in drive.problems(model)]
    yield from messages[::-1] or ["its wheels roll along the line between the sides"]


_MAX_DIFF_WHEELS: Final = 3  # more wheels cannot belong to a differential drive


WheelRadius = Annotated[PositiveMetres | None, Field(description="radius of the wheels; default: read from the model")]

MotorTorque = Annotated[
    PositiveNewtonMetres | None, Field(description="torque limit of each wheel motor; default: the limit of its joint")
]

Heading = Annotated[
    Radians | None,
    Field(description="direction of forward from the base's x axis, positive to the left; default: that of the wheels"),
]

MIN_LENGTH_M: Final = 1e-6  # smaller wheels would need speeds that overflow
_MAX_LENGTH_M: Final = 1e3

# A joint with a range of this many rad counts as continuous: exporters write limits such as 1e9.
_CONTINUOUS_RANGE: Final = 1e5

_ROUNDING: Final = 1e-6  # relative tolerance: speeds equal to the limit differ from it by rounding
_MIN_SHOWN_DEG: Final = 0.05  # smaller headings come from rounded digits of pi in a file


class WheelSpeeds:
    """The speed limits of wheels. All wheels slow down by the same factor, so the curve keeps its shape.

    `notes`: a note on the first twist that exceeded a limit.
    """

    def __init__(self, model: RobotModel, wheels: Iterable[str]) -> None:
        limits = {name: model.joints_by_name[name].max_velocity for name in wheels}
        self._limits = {name: limit for name, limit in limits.items() if limit is not None}
        self.notes: tuple[str, ...] = ()

    def share(self, asked: Mapping[str, float]) -> float:
        """Return the factor for these speeds (joint -> rad/s) that keeps every wheel in its limit; at most 1.0."""
        return self._least(asked)[0]

    def told_share(self, twist: Mapping[str, float]) -> float:
        """Return the same factor for the speeds of a twist, and note a factor below 1."""
        share, name = self._least(twist)
        if name and not self.notes:
            speed, most = units.display_apart(abs(twist[name]), self._limits[name], "rad/s")
            limit = f"a twist asked joint '{name}' for {speed}, but its limit in the model is {most}"
            self.notes = (f"{limit}: all wheels were slowed by the same factor, so the curve is unchanged",)
        return share

    def _least(self, asked: Mapping[str, float]) -> tuple[float, str]:
        shares = ((limit / abs(asked[name]), name) for name, limit in self._limits.items() if asked[name])
        share, name = min(shares, default=(1.0, ""))
        return (share, name) if share < 1 - _ROUNDING else (1.0, "")


def why_no_wheel(model: RobotModel, name: str) -> str | None:
    """Return the reason why no wheel can turn about a joint, else None. Engines would ignore its limits at first."""
    if (trouble := model.why_not_driven(name)) is not None:
        return trouble
    joint = model.joints_by_name[name]
    if joint.type == "prismatic":
        return f"joint '{name}' slides: a wheel needs a 'continuous' joint"
    if joint.lower is None or joint.upper is None or not 0 <= joint.upper - joint.lower < _CONTINUOUS_RANGE:
        return None
    limits = f"{units.display(joint.lower, 'rad')} to {units.display(joint.upper, 'rad')}"
    return f"joint '{name}' has limits, {limits}: a wheel needs a 'continuous' joint"


def joint_problems(model: RobotModel, key: str, names: Sequence[str]) -> SpecProblems:
    """Yield joints that cannot turn a wheel, each with its place below the key of the drive."""
    for index, name in enumerate(names):
        if (trouble := why_no_wheel(model, name)) is not None:
            yield (key, index), trouble


def length_problems(drive: Drive, *keys: str) -> SpecProblems:
    """Yield stated lengths that are too small or too large."""
    for key in keys:
        length = getattr(drive, key) or 0
        if 0 < length < MIN_LENGTH_M:
            yield (key,), f"must be at least {MIN_LENGTH_M:g} m"
        elif length > _MAX_LENGTH_M:
            yield (key,), f"must be at most {_MAX_LENGTH_M:g} m"


def heading_text(heading: float) -> str:
    """Return a heading as text; empty for the base's x axis."""
    degrees = math.degrees(heading)
    return f", heading {degrees:.4g} deg from the base's x axis" if abs(degrees) >= _MIN_SHOWN_DEG else ""


def radius_text(radii: Sequence[float]) -> str:
    """Return wheel radii as text."""
    texts = dict.fromkeys(f"{radius:.4g} m" for radius in radii)
    return f"wheel {'radius' if len(texts) == 1 else 'radii'} {', '.join(texts)}"


def torque_text(torque: float | None, model: RobotModel, names: Sequence[str]) -> str:
    """Return the torque limits of wheel motors as text; empty if there are none."""
    limits = [torque] if torque is not None else [model.joints_by_name[name].max_effort for name in names]
    texts = dict.fromkeys(units.display(limit, "N m") for limit in limits if limit)
    return f", torque {' and '.join(texts)}" if texts else ""


def ramp_towards(goal: float, value: float, most: float) -> float:
    """Return the value after one step towards `goal`, changed by `most` at most."""
    # Called at every step of a ramp: comparisons are faster than `min` and `max`.
    change = goal - value
    if change > most:
        change = most
    elif change < -most:
        change = -most
    return value + change
