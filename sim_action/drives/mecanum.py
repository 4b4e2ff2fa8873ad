"""Mecanum wheels: four, whose rollers let the robot go sideways as well."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from statistics import fmean
from typing import Annotated, ClassVar, Final, Self

from pydantic import Field

from sim_action.core import units
from sim_action.core.field_types import PositiveMetresPerSecondSquared, PositiveNewtons
from sim_action.core.geometry import Twist, Vector3
from sim_action.core.yaml_errors import SpecProblems
from sim_action.drives import Drive, is_level
from sim_action.drives.plugins import StatedSides, corners_by_plugin
from sim_action.drives.wheel_settings import (
    Heading,
    WheelRadius,
    WheelSpeeds,
    heading_text,
    joint_problems,
    length_problems,
    radius_text,
    remarked,
)
from sim_action.drives.wheels import Rolling, Wheel, along, axle_problems, centre_of_mass, heading_of, rolling, wheel
from sim_action.robot.kinematics import Mobility
from sim_action.robot.robot_model import RobotModel
from sim_action.state.command import NO_PUSH, BasePush, JointTargets
from sim_action.state.sensor_inputs import PlanarWay
from sim_action.world.physics import GRAVITY
from sim_action.world.scene import Scene

# Of the weight that is on them, what rollers at 45 deg hold with a friction of 1.
_HOLD: Final = 1 / math.sqrt(2)

# Front left, rear left, front right, rear right.
_CORNERS: Final = [(1, 1), (-1, 1), (1, -1), (-1, -1)]

Pair = Annotated[tuple[str, ...], Field(min_length=2, max_length=2)]

NOT_LEVEL: Final = "a twist asked for more than velocity over the ground and turning rate; the rest was left out"


class MecanumDrive(Drive):
    """Four mecanum wheels, front and rear: forward, sideways and turning at once; kinematic, rollers are not modelled.

    Wheels turn as their inverse kinematics says, and have no friction; the base is pushed to its velocity by a force
    that is limited, and acts where the wheels touch the ground. A script that turns the wheels by hand takes them over:
    the base is pushed no more. Beyond the velocity limit of a wheel's joint in the model, all three are slowed alike,
    and the outcome has a note.
    """

    key: ClassVar[str] = "mecanum"

    left: Annotated[Pair, Field(description="joints of the wheels on the left: front, rear")]
    right: Annotated[Pair, Field(description="joints of the wheels on the right: front, rear")]
    radius: WheelRadius = None
    acceleration: Annotated[
        PositiveMetresPerSecondSquared, Field(description="limit of the velocity's change, also where wheels are")
    ] = 1.0
    force: Annotated[
        PositiveNewtons | None,
        Field(
            description="that pushes the base at the most; left out: what rollers hold, 0.7 of its weight in this world"
        ),
    ] = None
    heading: Heading = None

    @classmethod
    def recognise(cls, model: RobotModel) -> Self | None:
        """What gz's plugin in the model says: without it, the wheels look like those of skid steer."""
        stated = corners_by_plugin(model)
        return cls._of(stated) if stated else None

    @classmethod
    def _of(cls, stated: StatedSides) -> Self:
        return cls(left=stated.left, right=stated.right, **stated.figures)

    def problems(self, model: RobotModel) -> SpecProblems:
        """Joints that the model has not, wheels that do not roll or are not where they should be."""
        unknown = [*joint_problems(model, "left", self.left), *joint_problems(model, "right", self.right)]
        yield from unknown
        if unknown:
            return
        yield from length_problems(self, "radius")
        if model.mjcf:
            yield (), "wheels of MJCF keep the friction of their geoms, and mecanum wheels slide; use a model in URDF"
        heading = self._forward(model)
        for found in self._wheels(model):
            yield from axle_problems(found, heading)
            if self.radius is None and found.radius is None:
                yield (), f"the model does not tell the radius of the wheel at '{found.joint}'; give 'radius'"
        if self._corners(model) != _CORNERS:
            yield (), "the wheels are not at the corners: left: [front, rear], right: [front, rear]; or give 'heading'"

    def open(self, model: RobotModel, rate: float, gravity: float = GRAVITY) -> MecanumMotion:
        """See Drive.open."""
        x, y, _ = centre_of_mass(model)
        lowest = min(found.position_xyz[2] - radius for found, radius in self._tyres(model))
        point: Vector3 = (x, y, lowest)
        return MecanumMotion(
            self._rollers(model),
            heading=self._forward(model),
            most_change=self.acceleration / rate,
            speeds=WheelSpeeds(model, (*self.left, *self.right)),
            force=self._force(model, gravity),
            point_xyz=point,
        )

    def wheel_motion(self, model: RobotModel) -> MecanumOdometry:
        """See Drive.wheel_motion."""
        return MecanumOdometry(self._rollers(model), self._forward(model))

    def describe(self, model: RobotModel, gravity: float = GRAVITY) -> str:
        """See Drive.describe."""
        front_left, rear_left, front_right, _ = self._placed(model)
        wheelbase, separation = front_left.ahead - rear_left.ahead, front_left.left - front_right.left
        assumed = "" if self.force else " (0.7 of its weight)"
        figures = (
            f"mecanum drive, kinematic: left {', '.join(self.left)}; right {', '.join(self.right)}; "
            f"{radius_text([radius for _, radius in self._tyres(model)])}, wheelbase {wheelbase:.4g} m, "
            f"separation {separation:.4g} m, acceleration {self.acceleration:.4g} m/s^2, wheels without friction, "
            f"pushed by up to {units.display(self._force(model, gravity), 'N')}{assumed}"
            f"{heading_text(self._forward(model))}"
        )
        stated = corners_by_plugin(model)
        return remarked(figures, stated.remarks if stated and self == self._of(stated) else ())

    def mobility(self, model: RobotModel) -> Mobility:
        """See Drive.mobility."""
        return Mobility(
            heading=self._forward(model),
            acceleration=self.acceleration,
            turn_acceleration=self.acceleration / arm(self._placed(model)),
        )

    def prepared(self, scene: Scene) -> Scene:
        """With wheels that slide: their rollers roll. See Drive.prepared."""
        joints = scene.model.joints_by_name
        wheels = {joints[name].child for name in (*self.left, *self.right)}
        links = tuple(
            replace(link, surface=replace(link.surface, friction=0.0)) if link.name in wheels else link
            for link in scene.model.links
        )
        return replace(super().prepared(scene), model=replace(scene.model, links=links))

    def _wheels(self, model: RobotModel) -> list[Wheel]:
        return [wheel(model, name) for name in (*self.left, *self.right)]

    def _tyres(self, model: RobotModel) -> list[tuple[Wheel, float]]:
        return [(found, radius) for found in self._wheels(model) if (radius := self.radius or found.radius)]

    def _rollers(self, model: RobotModel) -> tuple[Roller, ...]:
        heading = self._forward(model)
        placed = [(rolling(found, heading), radius) for found, radius in self._tyres(model)]
        ways = [ahead * left for ahead, left in _CORNERS]
        return tuple(Roller(at, at.turns * radius, way) for (at, radius), way in zip(placed, ways, strict=True))

    def _forward(self, model: RobotModel) -> float:
        if self.heading is not None:
            return self.heading
        wheels = self._wheels(model)
        return heading_of(wheels, wheels[:2], wheels[2:])

    def _placed(self, model: RobotModel) -> list[Rolling]:
        heading = self._forward(model)
        return [rolling(found, heading) for found in self._wheels(model)]

    def _corners(self, model: RobotModel) -> list[tuple[int, int]]:
        """Where each wheel is, seen from the middle of them all: in front or not, on the left or not."""
        placed = self._placed(model)
        ahead, left = fmean(each.ahead for each in placed), fmean(each.left for each in placed)
        return [(1 if each.ahead > ahead else -1, 1 if each.left > left else -1) for each in placed]

    def _force(self, model: RobotModel, gravity: float) -> float:
        return self.force or _HOLD * model.mass * gravity


@dataclass(frozen=True, slots=True)
class Roller:
    """A wheel with rollers at 45 deg, which form an X seen from above.

    Attributes:
        gear: m that it would roll forward while its joint turns by 1 rad.
        way: 1 if it is in front on the left, or in the rear on the right; -1 on the other diagonal.
    """

    place: Rolling
    gear: float
    way: int

    def speed(self, ahead: float, left: float, turn: float) -> float:
        """Of its joint in rad/s, for a velocity of the base in m/s and rad/s."""
        here = (ahead - turn * self.place.left, left + turn * self.place.ahead)
        # Its rollers give way along one diagonal: what is left is across.
        return (here[0] - self.way * here[1]) / self.gear


def arm(wheels: Sequence[Rolling]) -> float:
    """How far wheels are from the base's origin in the mean, in m."""
    return fmean(math.hypot(placed.ahead, placed.left) for placed in wheels)


class MecanumMotion:
    """Velocity over the ground and turning rate, ramping towards what the last twist asks for."""

    def __init__(
        self,
        wheels: Sequence[Roller],
        *,
        heading: float,
        most_change: float,
        speeds: WheelSpeeds,
        force: float,
        point_xyz: Vector3,
    ) -> None:
        """`most_change`: m/s a step, of the velocity, and of what turning is at the wheels."""
        self._wheels = tuple(wheels)
        self._heading = heading
        self._most_change = most_change
        self._speeds = speeds
        self._force = force
        self._point_xyz = point_xyz
        self._arm = arm([found.place for found in wheels])
        self._ahead = self._left = self._turn = 0.0
        self._was_level = True

    @property
    def joints(self) -> frozenset[str]:
        """See DriveMotion.joints."""
        return frozenset(found.place.joint for found in self._wheels)

    @property
    def notes(self) -> tuple[str, ...]:
        """See DriveMotion.notes."""
        return (*(() if self._was_level else (NOT_LEVEL,)), *self._speeds.notes)

    @property
    def released(self) -> JointTargets:
        """See DriveMotion.released."""
        return JointTargets(base=NO_PUSH)

    def targets(self, twist: Twist, steps: int) -> list[JointTargets]:
        """See DriveMotion.targets."""
        self._was_level &= is_level(twist)
        wanted = self._wanted(twist)
        planned = []
        for _ in range(steps):
            before = (self._ahead, self._left, self._turn)
            self._step(*wanted)
            planned.append(self._joint_targets())
            if before == (self._ahead, self._left, self._turn):
                break
        return planned

    def _wanted(self, twist: Twist) -> tuple[float, float, float]:
        """Velocity ahead and to the left and turning rate, as far as motors can."""
        (ahead, left, _), turn = twist.linear_xyz, twist.angular_xyz[2]
        share = self._speeds.told_share(self._joint_speeds(ahead, left, turn))
        return share * ahead, share * left, share * turn

    def _step(self, ahead: float, left: float, turn: float) -> None:
        """All three change by the same part of their way, so that the curve stays the one that was asked for."""
        change = math.hypot(ahead - self._ahead, left - self._left) + self._arm * abs(turn - self._turn)
        if change <= self._most_change:
            self._ahead, self._left, self._turn = ahead, left, turn
            return
        part = self._most_change / change
        self._ahead += part * (ahead - self._ahead)
        self._left += part * (left - self._left)
        self._turn += part * (turn - self._turn)

    def _joint_targets(self) -> JointTargets:
        velocity_xy = along(self._heading, self._ahead, self._left)
        return JointTargets(
            velocity=self._joint_speeds(self._ahead, self._left, self._turn),
            base=BasePush(velocity_xy, self._turn, self._point_xyz, self._force, self._force * self._arm),
        )

    def _joint_speeds(self, ahead: float, left: float, turn: float) -> dict[str, float]:
        """In rad/s, for a velocity of the base in m/s and rad/s."""
        return {found.place.joint: found.speed(ahead, left, turn) for found in self._wheels}


@dataclass(frozen=True)
class MecanumOdometry:
    """The inverse of `mecanum_motion`: the way that suits all wheels best.

    Attributes:
        heading: rad, of forward from the base's x axis.
    """

    wheels: tuple[Roller, ...]
    heading: float
    middle_xy: tuple[float, float] = (0.0, 0.0)
    steering: tuple[str, ...] = ()

    @property
    def gears(self) -> Mapping[str, float]:
        """See WheelMotion.gears."""
        return {found.place.joint: found.gear for found in self.wheels}

    def way(self, rolled: Mapping[str, float], steered: Mapping[str, float]) -> PlanarWay:
        """See WheelMotion.way."""
        ahead, left, turn = (
            sum(share * rolled[found.place.joint] for share, found in zip(row, self.wheels, strict=True))
            for row in self._shares
        )
        return PlanarWay(*along(self.heading, ahead, left), turn)

    @cached_property
    def _shares(self) -> list[list[float]]:
        """(3, 4): what each wheel has to say of the way ahead, of that to the left, and of the turn: least squares."""
        import numpy as np

        motions = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
        ways = [[found.gear * found.speed(*motion) for motion in motions] for found in self.wheels]
        shares: list[list[float]] = np.linalg.pinv(np.array(ways)).tolist()
        return shares
