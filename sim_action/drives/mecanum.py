"""Mecanum drive: four wheels with rollers, which can also move the robot sideways."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from statistics import fmean
from typing import Annotated, ClassVar, Final, Self

from pydantic import Field
from typing_extensions import override

from sim_action.core import geometry, units
from sim_action.core.field_types import PositiveMetresPerSecondSquared, PositiveNewtons
from sim_action.core.geometry import Twist, Vector3
from sim_action.core.lazy_numpy import np
from sim_action.core.records import dataclass, replace
from sim_action.core.yaml_document import SpecProblems
from sim_action.drives import (
    Drive,
    DriveMotion,
    Heading,
    WheelRadius,
    WheelSpeeds,
    heading_text,
    is_level,
    joint_problems,
    length_problems,
    radius_text,
)
from sim_action.drives.plugins import NoDrive, Stated, corners_by_plugin
from sim_action.drives.wheels import (
    Rolling,
    Wheel,
    along,
    axle_problems,
    centre_of_mass,
    heading_of,
    largest_radius,
    rolling,
    wheel,
    wheels_on_ground,
)
from sim_action.robot.model.kinematics import Mobility
from sim_action.robot.model.robot_model import RobotModel
from sim_action.state.command import NO_PUSH, BasePush, JointTargets
from sim_action.state.readings import PlanarWay
from sim_action.world.physics import GRAVITY
from sim_action.world.scene import Scene

_ROLLER_GRIP: Final = 1 / math.sqrt(2)  # the grip of rollers at 45 deg with a friction of 1, as a share of the weight
_CORNERS: Final = [(1, 1), (-1, 1), (1, -1), (-1, -1)]  # front left, rear left, front right, rear right
Pair = Annotated[tuple[str, ...], Field(min_length=2, max_length=2)]
NOT_LEVEL: Final = "a twist had components other than velocity over the ground and turn rate; they were ignored"


class MecanumDrive(Drive):
    """Four mecanum wheels, front and rear: forward, sideways and turning at once. Kinematic, without rollers.

    The wheels turn by their inverse kinematics and have no friction; a limited force at ground level pushes the base to
    its velocity. If a script controls the wheels directly, the base is not pushed. If a wheel would exceed its velocity
    limit, all three velocities are reduced by the same factor, with a note.
    """

    key: ClassVar[str] = "mecanum"
    moves_base: ClassVar[bool] = True

    left: Annotated[Pair, Field(description="joints of the wheels on the left: front, rear")]
    right: Annotated[Pair, Field(description="joints of the wheels on the right: front, rear")]
    radius: WheelRadius = None
    acceleration: Annotated[
        PositiveMetresPerSecondSquared,
        Field(description="limit of the acceleration of the base and, when it turns, of the wheels' positions"),
    ] = 1.0
    force: Annotated[
        PositiveNewtons | None,
        Field(description="maximum force on the base; default: the grip of rollers, 0.7 of its weight in this world"),
    ] = None
    heading: Heading = None

    @classmethod
    def statements(cls, model: RobotModel) -> Stated | None:
        """Return the statements of a plugin; the looks of such wheels also fit skid steer."""
        return corners_by_plugin(model)

    @classmethod
    def by_wheels(cls, model: RobotModel) -> Self:
        """Rollers are not modelled as joints."""
        looks = "the wheels on the ground show no rollers" if wheels_on_ground(model) else "no wheel is on the ground"
        raise NoDrive(f"no plugin or controller states four mecanum wheels, and {looks}")

    @override
    def source(self, model: RobotModel) -> str:
        stated = corners_by_plugin(model)
        return stated.source if stated else "geometry"

    def problems(self, model: RobotModel) -> SpecProblems:
        """Yield unknown joints, wheels that do not roll, and wheels that are not at the corners."""
        unknown = [*joint_problems(model, "left", self.left), *joint_problems(model, "right", self.right)]
        yield from unknown
        if unknown:
            return
        yield from length_problems(self, "radius")
        if model.mjcf:
            yield (), "mecanum wheels need zero friction, but MJCF wheels keep that of their geoms; use a URDF model"
        heading = self._forward(model)
        for driven_wheel in self._wheels(model):
            yield from axle_problems(driven_wheel, heading)
            if self.radius is None and driven_wheel.radius is None:
                yield (), f"the model has no radius for the wheel at '{driven_wheel.joint}'; give 'radius'"
        if self._corners(model) != _CORNERS:
            yield (
                (),
                "the wheels are not at the corners; give left: [front, rear] and right: [front, rear], or 'heading'",
            )

    @override
    def open(self, model: RobotModel, rate: float, gravity: float = GRAVITY) -> MecanumMotion:
        x, y, _ = centre_of_mass(model)
        lowest = min(driven_wheel.position_xyz[2] - radius for driven_wheel, radius in self._tyres(model))
        return MecanumMotion(
            self._rollers(model),
            self._forward(model),
            arm(self._placed(model)),
            most_change=self.acceleration / rate,
            speeds=WheelSpeeds(model, (*self.left, *self.right)),
            force=self._force(model, gravity),
            point_xyz=(x, y, lowest),
        )

    @override
    def wheel_motion(self, model: RobotModel) -> MecanumOdometry:
        return MecanumOdometry(self._rollers(model), self._forward(model))

    @override
    def figures(self, model: RobotModel, gravity: float) -> str:
        front_left, rear_left, front_right, _ = self._placed(model)
        wheelbase, separation = front_left.ahead - rear_left.ahead, front_left.left - front_right.left
        assumed = "" if self.force else " (0.7 of its weight)"
        return (
            f"mecanum drive, kinematic: left {', '.join(self.left)}; right {', '.join(self.right)}; "
            f"{radius_text([radius for _, radius in self._tyres(model)])}, wheelbase {wheelbase:.4g} m, "
            f"separation {separation:.4g} m, acceleration {self.acceleration:.4g} m/s^2, wheels without friction, "
            f"pushed by up to {units.display(self._force(model, gravity), 'N')}{assumed}"
            f"{heading_text(self._forward(model))}"
        )

    @override
    def lengths(self, model: RobotModel) -> Mapping[str, float]:
        return {"radius": largest_radius(self._wheels(model))}

    @override
    def mobility(self, model: RobotModel) -> Mobility:
        return Mobility(
            heading=self._forward(model),
            acceleration=self.acceleration,
            turn_acceleration=self.acceleration / arm(self._placed(model)),
        )

    def prepared(self, scene: Scene) -> Scene:
        """Sets the friction of the wheels to zero, because their rollers roll."""
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
        return [
            (driven_wheel, radius)
            for driven_wheel in self._wheels(model)
            if (radius := self.radius or driven_wheel.radius)
        ]

    def _rollers(self, model: RobotModel) -> tuple[Roller, ...]:
        heading = self._forward(model)
        placed = [(rolling(driven_wheel, heading), radius) for driven_wheel, radius in self._tyres(model)]
        ways = [ahead * left for ahead, left in _CORNERS]
        return tuple(Roller(at, at.turns * radius, way) for (at, radius), way in zip(placed, ways, strict=True))

    def _forward(self, model: RobotModel) -> float:
        if self.heading is not None:
            return self.heading
        wheels = self._wheels(model)
        return heading_of(wheels, wheels[:2], wheels[2:])

    def _placed(self, model: RobotModel) -> list[Rolling]:
        heading = self._forward(model)
        return [rolling(driven_wheel, heading) for driven_wheel in self._wheels(model)]

    def _corners(self, model: RobotModel) -> list[tuple[int, int]]:
        placed = self._placed(model)
        ahead, left = fmean(place.ahead for place in placed), fmean(place.left for place in placed)
        return [(1 if place.ahead > ahead else -1, 1 if place.left > left else -1) for place in placed]

    def _force(self, model: RobotModel, gravity: float) -> float:
        return self.force or _ROLLER_GRIP * model.mass * gravity


@dataclass(frozen=True, slots=True)
class Roller:
    """A wheel with rollers at 45 deg that form an X seen from above."""

    place: Rolling
    gear: float  # distance in m that it would roll forward per rad of its joint
    way: int  # 1 at the front left and the rear right, -1 on the other diagonal

    def speed(self, ahead: float, left: float, turn: float) -> float:
        """Return the joint speed in rad/s, for a velocity of the base in m/s and rad/s."""
        velocity = (ahead - turn * self.place.left, left + turn * self.place.ahead)
        # The rollers slip along one diagonal; only the motion across it turns the wheel.
        return (velocity[0] - self.way * velocity[1]) / self.gear


def arm(wheels: Sequence[Rolling]) -> float:
    """Return the mean distance of wheels from the base's origin, in m."""
    return fmean(math.hypot(placed.ahead, placed.left) for placed in wheels)


@dataclass(eq=False)
class MecanumMotion(DriveMotion):
    """Velocity over the ground and turn rate, with a ramp towards the last twist."""

    wheels: Sequence[Roller]
    heading: float
    arm: float  # m, the mean distance of the wheels from the base's origin
    most_change: float  # in m/s per step, of the velocity and of the rim speed due to turning
    speeds: WheelSpeeds
    force: float
    point_xyz: Vector3
    _ahead: float = 0.0
    _left: float = 0.0
    _turn: float = 0.0
    _was_level: bool = True

    @cached_property
    @override
    def joints(self) -> frozenset[str]:
        return frozenset(roller.place.joint for roller in self.wheels)

    @property
    @override
    def notes(self) -> tuple[str, ...]:
        return (*(() if self._was_level else (NOT_LEVEL,)), *self.speeds.notes)

    @property
    @override
    def released(self) -> JointTargets:
        return JointTargets(base=NO_PUSH)

    @override
    def targets(self, twist: Twist, steps: int) -> list[JointTargets]:
        self._was_level &= is_level(twist)
        (ahead, left, _), turn = twist.linear_xyz, twist.angular_xyz[2]
        share = self.speeds.told_share(self._joint_speeds(ahead, left, turn))
        goal = share * ahead, share * left, share * turn
        planned = []
        for _ in range(steps):
            before = (self._ahead, self._left, self._turn)
            self._step(*goal)
            planned.append(self._joint_targets())
            if before == (self._ahead, self._left, self._turn):
                break
        return planned

    def _step(self, ahead: float, left: float, turn: float) -> None:
        """Change all three by the same share, so that the curve keeps its shape."""
        change = math.hypot(ahead - self._ahead, left - self._left) + self.arm * abs(turn - self._turn)
        if change <= self.most_change:
            self._ahead, self._left, self._turn = ahead, left, turn
            return
        part = self.most_change / change
        self._ahead += part * (ahead - self._ahead)
        self._left += part * (left - self._left)
        self._turn += part * (turn - self._turn)

    def _joint_targets(self) -> JointTargets:
        velocity_xy = along(self.heading, self._ahead, self._left)
        return JointTargets(
            velocity=self._joint_speeds(self._ahead, self._left, self._turn),
            base=BasePush(velocity_xy, self._turn, self.point_xyz, self.force, self.force * self.arm),
        )

    def _joint_speeds(self, ahead: float, left: float, turn: float) -> dict[str, float]:
        return {roller.place.joint: roller.speed(ahead, left, turn) for roller in self.wheels}


@dataclass(frozen=True)
class MecanumOdometry:
    """The inverse of `MecanumMotion`: the motion of the base that fits all wheels best."""

    wheels: tuple[Roller, ...]
    heading: float  # direction of forward, in rad from the base's x axis
    middle_xy: tuple[float, float] = (0.0, 0.0)
    steering: tuple[str, ...] = ()

    @property
    def gears(self) -> Mapping[str, float]:
        """The rolling distance in m for 1 rad of each wheel joint."""
        return {roller.place.joint: roller.gear for roller in self.wheels}

    def way(self, rolled: Mapping[str, float], steered: Mapping[str, float]) -> PlanarWay:
        """Return the motion of the reference point that fits the wheels best."""
        ahead, left, turn = (
            sum(share * rolled[roller.place.joint] for share, roller in zip(row, self.wheels, strict=True))
            for row in self._shares
        )
        return PlanarWay(*along(self.heading, ahead, left), turn)

    @cached_property
    def _shares(self) -> list[list[float]]:
        """Coefficients (3, 4) of each wheel for motion ahead, to the left and turning (least squares)."""
        motions = geometry.AXES
        ways = [[roller.gear * roller.speed(*motion) for motion in motions] for roller in self.wheels]
        shares: list[list[float]] = np.linalg.pinv(np.array(ways)).tolist()
        return shares
