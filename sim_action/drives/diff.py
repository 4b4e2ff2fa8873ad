"""Differential drive: the left and right wheels have independent speeds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property, lru_cache
from math import fsum
from typing import Annotated, ClassVar, Final, Self

from pydantic import Field
from typing_extensions import override

from sim_action.core.field_types import PositiveMetres, PositiveMetresPerSecondSquared
from sim_action.core.geometry import Twist
from sim_action.core.records import dataclass, replace
from sim_action.core.yaml_document import SpecProblems
from sim_action.drives import (
    MAX_STATED_DEVIATION,
    MIN_LENGTH_M,
    NOT_PLANAR,
    Drive,
    DriveMotion,
    Heading,
    MotorTorque,
    WheelRadius,
    WheelSpeeds,
    heading_text,
    is_planar,
    joint_problems,
    length_problems,
    radius_text,
    ramp_towards,
    torque_text,
)
from sim_action.drives.plugins import DIFF_PLUGINS, Kind, NoDrive, Stated, sides_by_plugin
from sim_action.drives.undercarriage import driven_pair
from sim_action.drives.wheels import (
    Rolling,
    Wheel,
    along,
    axle_problems,
    heading_of,
    largest_radius,
    rolling,
    turned_forward,
    wheel,
)
from sim_action.robot.model.kinematics import Mobility, SameModel
from sim_action.robot.model.robot_model import RobotModel
from sim_action.state.command import JointTargets
from sim_action.state.readings import PlanarWay
from sim_action.world.physics import GRAVITY

JointNames = Annotated[tuple[str, ...], Field(min_length=1)]
_BACKWARD: Final = math.radians(135)  # a heading beyond this, in rad from the base's x axis, is probably a mistake


class TwoSidedDrive(Drive):
    """The base class of drives with wheels on the left and on the right."""

    title: ClassVar[str]  # the name in messages
    plugins: ClassVar[tuple[Kind, ...]]  # kinds of the plugins that state its wheels

    left: Annotated[JointNames, Field(description="joints of the wheels on the left")]
    right: Annotated[JointNames, Field(description="joints of the wheels on the right")]
    radius: WheelRadius = None
    separation: Annotated[
        PositiveMetres | None, Field(description="distance between left and right wheels; default: read from the model")
    ] = None
    acceleration: Annotated[
        PositiveMetresPerSecondSquared, Field(description="limit of the acceleration at the rim of a wheel")
    ] = 1.0
    torque: MotorTorque = None
    heading: Heading = None

    @classmethod
    @override
    def statements(cls, model: RobotModel) -> Stated | None:
        return sides_by_plugin(model, cls.plugins)

    @classmethod
    def stated(cls, model: RobotModel) -> Self | None:
        """Return the stated drive; None if its wheels would roll along the line between the sides."""
        drive = super().stated(model)
        return drive if drive and drive.is_across(model) else None

    def is_across(self, model: RobotModel) -> bool:
        """Return True unless the sides are far apart in the model, but not across the direction of forward."""
        left, right = self.sides(model)
        way = (_mean_left(left) - _mean_left(right), _mean([p.ahead for p in left]) - _mean([p.ahead for p in right]))
        return abs(way[0]) >= MAX_STATED_DEVIATION * math.hypot(*way)

    @classmethod
    def as_stated(cls, model: RobotModel, stated: Stated) -> Self:
        """Return the drive that a plugin states. In Gazebo, positive joint velocity means forward on both sides."""
        drive = cls(**stated.keys)
        heading = turned_forward(drive._wheels(model))
        if heading is None or (abs(heading) <= _BACKWARD and math.cos(heading - drive.forward(model)) > 0):
            return drive
        return drive.model_copy(update={"heading": heading})

    def problems(self, model: RobotModel) -> SpecProblems:
        """Yield unknown joints, wheels that do not roll, and lengths that are missing in the model."""
        unknown = [*joint_problems(model, "left", self.left), *joint_problems(model, "right", self.right)]
        yield from unknown
        if unknown:
            return
        yield from length_problems(self, "radius", "separation")
        if set(self.left) & set(self.right):
            yield ("right",), "a wheel cannot be on both sides"
            return
        heading = self.forward(model)
        for driven_wheel in self._wheels(model):
            yield from axle_problems(driven_wheel, heading)
        if self.is_swapped(model):
            yield ("left",), "these wheels are on the right in the model; swap 'left' and 'right', or give 'heading'"
        if self.separation is None and self.separation_in(model) < MIN_LENGTH_M:
            yield (), "the left and right wheels are at the same place in the model; give 'separation'"
        for driven_wheel in self._wheels(model):
            if self.radius is None and driven_wheel.radius is None:
                yield (), f"the model has no radius for the wheel at '{driven_wheel.joint}'; give 'radius'"
                return

    def is_swapped(self, model: RobotModel) -> bool:
        """Return True if the left wheels are on the right in the model, and no heading explains it."""
        return self.heading is None and abs(self.forward(model)) > _BACKWARD

    @override
    def open(self, model: RobotModel, rate: float, gravity: float = GRAVITY) -> TwoSidedMotion:
        gears = self._gears(model)
        left, right = (tuple((name, gears[name]) for name in side) for side in (self.left, self.right))
        separation, most_change = self._effective_separation(model), self.acceleration / rate
        return TwoSidedMotion((left, right), separation, most_change, WheelSpeeds(model, gears), self.torque)

    @override
    def wheel_motion(self, model: RobotModel) -> TwoSidedOdometry:
        heading = self.forward(model)
        left, right = self.sides(model)
        ahead = _mean([placed.ahead for placed in (*left, *right)])
        middle = along(heading, ahead, (_mean_left(left) + _mean_left(right)) / 2)
        separation = self._effective_separation(model)
        return TwoSidedOdometry(self._gears(model), self.left, self.right, separation, heading, middle)

    @override
    def mobility(self, model: RobotModel) -> Mobility:
        left, right = self.sides(model)
        return Mobility(
            heading=self.forward(model),
            ahead=-_mean([placed.ahead for placed in (*left, *right)]),
            acceleration=self.acceleration,
            turn_acceleration=2 * self.acceleration / self._effective_separation(model),
        )

    @override
    def figures(self, model: RobotModel, gravity: float) -> str:
        sides = f"left {', '.join(self.left)}; right {', '.join(self.right)}"
        separation = f"separation {self.separation_in(model):.4g} m{self.slip_text(model)}"
        torque = torque_text(self.torque, model, (*self.left, *self.right))
        return (
            f"{self.title}: {sides}; {radius_text([*self.radii(model).values()])}, {separation}, "
            f"acceleration {self.acceleration:.4g} m/s^2{torque}{heading_text(self.forward(model))}"
        )

    @override
    def plugin(self, model: RobotModel) -> str:
        stated = self.origin(model)
        return stated.source if stated else ""

    @override
    def lengths(self, model: RobotModel) -> Mapping[str, float]:
        separation = self.model_copy(update={"separation": None}).separation_in(model)
        return {"radius": largest_radius(self._wheels(model)), "separation": separation}

    def forward(self, model: RobotModel) -> float:
        """Return the direction of forward, in rad from the base's x axis to the left."""
        if self.heading is not None:
            return self.heading
        left, right = ([wheel(model, name) for name in side] for side in (self.left, self.right))
        return heading_of((*left, *right), left, right)

    def slip_factor(self, model: RobotModel) -> float:
        """Return the ratio of effective to geometric wheel separation in turns."""
        return 1.0

    def slip_text(self, model: RobotModel) -> str:
        """Return the slip factor as text."""
        return ""

    def sides(self, model: RobotModel) -> tuple[tuple[Rolling, ...], tuple[Rolling, ...]]:
        """Return the wheels on the left and those on the right."""
        return _sides(self, SameModel(model))

    def radii(self, model: RobotModel) -> dict[str, float]:
        """Return the wheel radius in m for each joint; unknown radii are left out (`problems` reports them)."""
        radii = {driven_wheel.joint: self.radius or driven_wheel.radius for driven_wheel in self._wheels(model)}
        return {joint: radius for joint, radius in radii.items() if radius is not None}

    def _gears(self, model: RobotModel) -> dict[str, float]:
        left, right = self.sides(model)
        radii = self.radii(model)
        return {placed.joint: placed.turns * radii[placed.joint] for placed in (*left, *right)}

    def _wheels(self, model: RobotModel) -> list[Wheel]:
        return [wheel(model, name) for name in (*self.left, *self.right)]

    def _effective_separation(self, model: RobotModel) -> float:
        return self.separation_in(model) * self.slip_factor(model)

    def separation_in(self, model: RobotModel) -> float:
        """Return the distance between left and right wheels in m."""
        if self.separation is not None:
            return self.separation
        left, right = self.sides(model)
        return abs(_mean_left(left) - _mean_left(right))


class DiffDrive(TwoSidedDrive):
    """Two sides of wheels. Forward speed is their mean speed, turn rate their difference over the separation.

    Wheel speeds follow a twist with a ramp, as in Gazebo's diff drive plugin (`wheelAcceleration`). If a wheel would
    exceed the velocity limit of its joint in the model, all wheels slow down by the same factor, which keeps the curve,
    and the result has a note.
    """

    key: ClassVar[str] = "diff"
    title: ClassVar[str] = "diff drive"
    plugins: ClassVar[tuple[Kind, ...]] = DIFF_PLUGINS

    @classmethod
    def statement(cls, model: RobotModel) -> Self | None:
        """Several wheels per side are skid steer."""
        drive = super().statement(model)
        return drive if drive and len(drive.left) == len(drive.right) == 1 else None

    @classmethod
    def by_wheels(cls, model: RobotModel) -> Self:
        """Two wheels are driven, none is steered, and joint names or a statement show the sides.

        Casters, and wheels without a motor, may stand on the ground as well.
        """
        left, right = driven_pair(model)
        drive = cls(left=(left,), right=(right,))
        if drive.is_swapped(model):
            raise NoDrive(
                f"'{left}' is on the right in the model and '{right}' on the left, so their names and places show "
                "different sides; state the sides in robot.drive"
            )
        return drive

    @classmethod
    def by_place(cls, model: RobotModel) -> Self | None:
        """Return the drive with the sides as placed if the names of its two wheels show the opposite, else None."""
        try:
            left, right = driven_pair(model)
        except NoDrive:
            return None
        return cls(left=(right,), right=(left,)) if cls(left=(left,), right=(right,)).is_swapped(model) else None


@dataclass(eq=False)
class TwoSidedMotion(DriveMotion):
    """Rim speeds of both sides, each with a ramp towards the last twist."""

    gears: _Gears  # each joint with the distance in m that its wheel rolls forward per rad
    separation: float
    most_change: float  # of a rim speed, in m/s per step
    speeds: WheelSpeeds
    torque: float | None
    _rims: _Rims = (0.0, 0.0)
    _was_planar: bool = True

    @cached_property
    @override
    def joints(self) -> frozenset[str]:
        return frozenset(name for side in self.gears for name, _ in side)

    @property
    @override
    def notes(self) -> tuple[str, ...]:
        return (*(() if self._was_planar else (NOT_PLANAR,)), *self.speeds.notes)

    @override
    def targets(self, twist: Twist, steps: int) -> list[JointTargets]:
        self._was_planar &= is_planar(twist)
        turn = twist.angular_xyz[2] * self.separation / 2
        left, right = twist.linear_xyz[0] - turn, twist.linear_xyz[0] + turn
        share = self.speeds.told_share(_joint_speeds(self.gears, left, right))
        # Adding 0 turns a negative zero into 0, so that equal speeds have the same ramp.
        rims = share * left + 0.0, share * right + 0.0
        planned, self._rims = _ramp(
            self.gears, self.torque, self._rims, rims, most_change=self.most_change, steps=steps
        )
        return list(planned)


# Of the left and the right side.
_Gears = tuple[tuple[tuple[str, float], ...], tuple[tuple[str, float], ...]]
_Rims = tuple[float, float]


# Runs of a sweep ask for the same ramps.
@lru_cache(maxsize=32)
def _ramp(
    gears: _Gears, torque: float | None, start: _Rims, goal: _Rims, *, most_change: float, steps: int
) -> tuple[tuple[JointTargets, ...], _Rims]:
    """Return the targets until both rim speeds in m/s are reached, for `steps` at most, and the last rim speeds."""
    limits = {} if torque is None else {name: torque for side in gears for name, _ in side}
    planned, rims = [], start
    for _ in range(steps):
        before = rims
        rims = (ramp_towards(goal[0], before[0], most_change), ramp_towards(goal[1], before[1], most_change))
        planned.append(JointTargets({}, _joint_speeds(gears, *rims), {}, limits))
        if before == rims:
            break
    return tuple(planned), rims


def _joint_speeds(gears: _Gears, left: float, right: float) -> dict[str, float]:
    """Return joint speeds in rad/s, for rim speeds in m/s."""
    of_left, of_right = gears
    return {name: left / gear for name, gear in of_left} | {name: right / gear for name, gear in of_right}


@dataclass(frozen=True)
class TwoSidedOdometry:
    """The inverse of `TwoSidedMotion`: the motion of the base from the rotation of the wheels."""

    gears: Mapping[str, float]
    left: tuple[str, ...]  # left, right: joints of the wheels
    right: tuple[str, ...]
    separation: float  # the effective separation in m
    heading: float  # direction of forward, in rad from the base's x axis
    middle_xy: tuple[float, float]
    steering: tuple[str, ...] = ()

    def way(self, rolled: Mapping[str, float], steered: Mapping[str, float]) -> PlanarWay:
        """Return the motion of the reference point that fits the wheels best."""
        left, right = (fsum(rolled[name] for name in side) / len(side) for side in (self.left, self.right))
        return PlanarWay(*along(self.heading, (left + right) / 2, 0.0), (right - left) / self.separation)


# A run asks for it a dozen times, and up to 10,000 variations share one model.
@lru_cache(maxsize=4)
def _sides(drive: TwoSidedDrive, same: SameModel) -> tuple[tuple[Rolling, ...], tuple[Rolling, ...]]:
    model, heading = same.model, drive.forward(same.model)
    left, right = (tuple(rolling(wheel(model, name), heading) for name in side) for side in (drive.left, drive.right))
    if drive.plugin(model):
        # A plugin gives each side one joint velocity, regardless of the axes.
        left, right = (tuple(replace(placed, turns=1.0) for placed in side) for side in (left, right))
    return left, right


def _mean_left(wheels: Sequence[Rolling]) -> float:
    return _mean([placed.left for placed in wheels])


def _mean(values: Sequence[float]) -> float:
    # The same result as statistics.fmean, whose import takes too long.
    return math.fsum(values) / len(values)
