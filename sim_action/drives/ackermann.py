"""Ackermann steering: each steered wheel has its own angle, so that no wheel slips in a curve.

All wheel axles meet in the centre of the curve. A curve is given by its curvature in 1/m, positive to the left: turn
rate over forward speed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from statistics import fmean
from typing import Annotated, ClassVar, Final, Self

from pydantic import Field
from typing_extensions import override

from sim_action.core import units
from sim_action.core.field_types import (
    PositiveMetres,
    PositiveMetresPerSecondSquared,
    PositiveRadians,
    PositiveRadiansPerSecond,
)
from sim_action.core.geometry import Twist
from sim_action.core.records import dataclass, field
from sim_action.core.yaml_document import SpecProblems
from sim_action.drives import (
    NOT_PLANAR,
    Drive,
    DriveMotion,
    Heading,
    MotorTorque,
    WheelRadius,
    WheelSpeeds,
    heading_text,
    is_planar,
    length_problems,
    radius_text,
    ramp_towards,
    torque_text,
    why_no_wheel,
)
from sim_action.drives.diff import JointNames
from sim_action.drives.plugins import Stated, steering_by_plugin
from sim_action.drives.undercarriage import car_joints
from sim_action.drives.wheels import (
    MIN_UPRIGHT_Z,
    Wheel,
    along,
    axle_problems,
    heading_of,
    largest_radius,
    rolling,
    steering_joint,
    wheel,
    wheels_on_ground,
)
from sim_action.robot.model.kinematics import Mobility
from sim_action.robot.model.robot_model import Joint, RobotModel
from sim_action.state.command import JointTargets
from sim_action.state.readings import PlanarWay
from sim_action.world.physics import GRAVITY

_MIN_WHEELBASE_M: Final = 1e-3  # steered wheels closer than this to the fixed axle cannot steer
ON_THE_SPOT = "a twist asked for a turn on the spot, which Ackermann steering cannot do: the robot stood still"
TOO_TIGHT = "a twist asked for a tighter curve than the steering allows: the robot took the tightest curve"


class AckermannDrive(Drive):
    """Steered and driven wheels. Each takes the angle and speed that its own radius of the curve requires.

    It cannot turn on the spot: such a command stops it. A curve that is tighter than the steering allows becomes the
    tightest possible one at the same speed. If a driven wheel would exceed its velocity limit, all wheels slow down by
    the same factor. A note reports each of these.
    """

    key: ClassVar[str] = "ackermann"

    steering: Annotated[
        JointNames, Field(max_length=2, description="joints that steer: left and right, or one in the middle")
    ]
    wheels: Annotated[JointNames, Field(description="joints of the driven wheels")]
    radius: WheelRadius = None
    wheelbase: Annotated[
        PositiveMetres | None,
        Field(description="distance from the fixed axle to the steering joints; default: read from the model"),
    ] = None
    track: Annotated[
        PositiveMetres | None,
        Field(
            description="distance between the steering joints, and between driven wheels; default: read from the model"
        ),
    ] = None
    steering_limit: Annotated[
        PositiveRadians | None,
        Field(
            lt=math.pi / 2,
            description="maximum angle of a steering joint; default: the smallest in the model, else 45 deg",
        ),
    ] = None
    steering_rate: Annotated[
        PositiveRadiansPerSecond | None, Field(description="maximum rate of a steering joint; default: the model's")
    ] = None
    acceleration: Annotated[PositiveMetresPerSecondSquared, Field(description="limit of the forward acceleration")] = (
        1.0
    )
    torque: MotorTorque = None
    heading: Heading = None

    @classmethod
    @override
    def statements(cls, model: RobotModel) -> Stated | None:
        return steering_by_plugin(model)

    @classmethod
    def by_wheels(cls, model: RobotModel) -> Self:
        """Two wheels are steered, by joints with limits, and two are fixed: the driven ones."""
        steering, wheels = car_joints(model)
        return cls(steering=steering, wheels=wheels)

    def problems(self, model: RobotModel) -> SpecProblems:
        """Yield unknown joints, joints that do not steer, wheels that do not roll, and missing lengths."""
        unknown = list(self._unknown_joints(model))
        yield from unknown
        if unknown:
            return
        yield from length_problems(self, "radius", "wheelbase", "track")
        heading = self._forward(model)
        wheels = [wheel(model, name) for name in self.wheels]
        for driven_wheel in wheels:
            yield from axle_problems(driven_wheel, heading)
        if without_radius := [
            driven_wheel.joint for driven_wheel in wheels if self.radius is None and driven_wheel.radius is None
        ]:
            yield (), f"the model has no radius for the wheel at '{without_radius[0]}'; give 'radius'"
        if self.wheelbase is None and not self._fixed_wheels(model):
            yield (), "every wheel of the model is steered; give 'wheelbase'"
        elif any(abs(pin.ahead) < _MIN_WHEELBASE_M for pin in self.kingpins(model)):
            yield ("steering",), "these joints are directly above the fixed axle; give 'wheelbase'"

    @override
    def open(self, model: RobotModel, rate: float, gravity: float = GRAVITY) -> AckermannMotion:
        limit = self._limit(model)
        pins = self.kingpins(model)
        return AckermannMotion(
            pins,
            self._driven(model),
            tightest(pins, limit.angle),
            most_steering=limit.rate / rate,
            most_speed=self.acceleration / rate,
            speeds=WheelSpeeds(model, self.wheels),
            max_effort={} if self.torque is None else dict.fromkeys(self.wheels, self.torque),
        )

    @override
    def wheel_motion(self, model: RobotModel) -> AckermannOdometry:
        heading = self._forward(model)
        middle = along(heading, self._axle(model), 0.0)
        return AckermannOdometry(self.kingpins(model), self._driven(model), heading, middle)

    @override
    def mobility(self, model: RobotModel) -> Mobility:
        return Mobility(
            heading=self._forward(model),
            ahead=-self._axle(model),
            tightest=tightest(self.kingpins(model), self._limit(model).angle),
            acceleration=self.acceleration,
            wheelbase=abs(fmean(pin.ahead for pin in self.kingpins(model))),
        )

    @override
    def figures(self, model: RobotModel, gravity: float) -> str:
        pins = self.kingpins(model)
        driven = self._driven(model)
        track = f", track {abs(pins[0].left - pins[1].left):.4g} m" if len(pins) > 1 else ""
        return (
            f"ackermann: steering {', '.join(self.steering)} {self._limit(model).text}; driven "
            f"{', '.join(self.wheels)}; {radius_text([abs(driven_wheel.gear) for driven_wheel in driven])}, "
            f"wheelbase {abs(fmean(pin.ahead for pin in pins)):.4g} m{track}, "
            f"acceleration {self.acceleration:.4g} m/s^2{torque_text(self.torque, model, self.wheels)}"
            f"{heading_text(self._forward(model))}"
        )

    @override
    def lengths(self, model: RobotModel) -> Mapping[str, float]:
        radius = largest_radius([wheel(model, name) for name in self.wheels])
        if not self._fixed_wheels(model):
            return {"radius": radius}
        pins = self.model_copy(update={"wheelbase": None}).kingpins(model)
        return {"radius": radius, "wheelbase": abs(fmean(pin.ahead for pin in pins))}

    def _unknown_joints(self, model: RobotModel) -> SpecProblems:
        for index, name in enumerate(self.steering):
            if (trouble := model.why_not_driven(name) or why_not_steering(model, name)) is not None:
                yield ("steering", index), trouble
        for index, name in enumerate(self.wheels):
            if name in self.steering:
                yield ("wheels", index), f"joint '{name}' steers; it cannot turn a wheel as well"
            elif (trouble := why_no_wheel(model, name)) is not None:
                yield ("wheels", index), trouble

    def _limit(self, model: RobotModel) -> SteeringLimit:
        joints = [model.joints_by_name[name] for name in self.steering]
        return limit_of(joints, self.steering_limit, self.steering_rate)

    def _forward(self, model: RobotModel) -> float:
        return heading_of([wheel(model, name) for name in self.wheels]) if self.heading is None else self.heading

    def _fixed_wheels(self, model: RobotModel) -> list[Wheel]:
        """Return the wheels on the axle that is not steered: driven ones, else any on the ground."""
        driven = [wheel(model, name) for name in self.wheels]
        for wheels in (driven, wheels_on_ground(model)):
            if fixed := [axle_wheel for axle_wheel in wheels if steering_joint(model, axle_wheel.joint) is None]:
                return fixed
        return []

    def _axle(self, model: RobotModel) -> float:
        heading = self._forward(model)
        return fmean(rolling(axle_wheel, heading).ahead for axle_wheel in self._fixed_wheels(model) or [STRAIGHT])

    def kingpins(self, model: RobotModel) -> tuple[Kingpin, ...]:
        """Return the steering joints with their places."""
        heading = self._forward(model)
        axle = self._axle(model)
        pins = list[Kingpin]()
        for name in self.steering:
            place = rolling(wheel(model, name), heading)
            ahead = place.ahead - axle
            if self.wheelbase is not None:
                ahead = math.copysign(self.wheelbase, ahead)
            pins.append(Kingpin(name, ahead, self._lateral(place.left), upright(model, name)))
        return tuple(pins)

    def _driven(self, model: RobotModel) -> tuple[DrivenWheel, ...]:
        heading = self._forward(model)
        driven = list[DrivenWheel]()
        pins = {pin.joint: pin for pin in self.kingpins(model)}
        for driven_wheel in (wheel(model, name) for name in self.wheels):
            place = rolling(driven_wheel, heading)
            above = steering_joint(model, driven_wheel.joint)
            radius = self.radius or driven_wheel.radius
            assert radius is not None, "problems() reports a missing radius"
            pin = pins.get(above.name) if above else None
            driven.append(DrivenWheel(driven_wheel.joint, place.turns * radius, self._lateral(place.left), pin))
        return tuple(driven)

    def _lateral(self, left: float) -> float:
        is_amid = self.track is None or abs(left) < _MIN_WHEELBASE_M
        return left if is_amid or self.track is None else math.copysign(self.track / 2, left)


@dataclass(eq=False)
class AckermannMotion(DriveMotion):
    """Forward speed and curvature, each with a ramp towards the last twist.

    Wheel speeds follow the current steering angle, not the angle that the steering is moving to.
    """

    kingpins: tuple[Kingpin, ...]
    wheels: tuple[DrivenWheel, ...]
    tightest: float
    most_steering: float  # rad per step
    most_speed: float  # m/s per step
    speeds: WheelSpeeds
    max_effort: Mapping[str, float]
    _speed: float = 0.0
    _curvature: float = 0.0
    _notes: dict[str, None] = field(default_factory=dict)

    @cached_property
    @override
    def joints(self) -> frozenset[str]:
        return frozenset([*(pin.joint for pin in self.kingpins), *(driven_wheel.joint for driven_wheel in self.wheels)])

    @property
    @override
    def notes(self) -> tuple[str, ...]:
        return (*self._notes, *self.speeds.notes)

    @override
    def targets(self, twist: Twist, steps: int) -> list[JointTargets]:
        if not is_planar(twist):
            self._notes[NOT_PLANAR] = None
        curvature = self._wanted_curvature(twist)
        speed = twist.linear_xyz[0] * self.speeds.told_share(self._wheel_speeds(twist.linear_xyz[0], curvature))
        planned = []
        for _ in range(steps):
            before = (self._speed, self._curvature)
            self._curvature = steered(self.kingpins, self._curvature, curvature, self.most_steering)
            ramped = ramp_towards(speed, self._speed, self.most_speed)
            self._speed = ramped * self.speeds.share(self._wheel_speeds(ramped, self._curvature))
            planned.append(self._joint_targets())
            if before == (self._speed, self._curvature):
                break
        return planned

    def _wanted_curvature(self, twist: Twist) -> float:
        speed, turn = twist.linear_xyz[0], twist.angular_xyz[2]
        if speed == 0:
            if turn != 0:
                self._notes[ON_THE_SPOT] = None
            # A robot that stops keeps its steering angle.
            return self._curvature
        if abs(turn) > self.tightest * abs(speed):
            self._notes[TOO_TIGHT] = None
            return self.tightest if turn * speed > 0 else -self.tightest
        return turn / speed

    def _wheel_speeds(self, speed: float, curvature: float) -> dict[str, float]:
        return {
            driven_wheel.joint: speed * driven_wheel.way(curvature) / driven_wheel.gear for driven_wheel in self.wheels
        }

    def _joint_targets(self) -> JointTargets:
        return JointTargets(
            position={pin.joint: pin.turns * pin.angle(self._curvature) for pin in self.kingpins},
            velocity=self._wheel_speeds(self._speed, self._curvature),
            max_effort=self.max_effort,
        )


@dataclass(frozen=True)
class AckermannOdometry:
    """The inverse of `AckermannMotion`: distance from the driven wheels, direction from the steering."""

    kingpins: tuple[Kingpin, ...]
    wheels: tuple[DrivenWheel, ...]
    heading: float  # direction of forward, in rad from the base's x axis
    middle_xy: tuple[float, float]

    @property
    def gears(self) -> Mapping[str, float]:
        """The rolling distance in m for 1 rad of each wheel joint."""
        return {driven_wheel.joint: driven_wheel.gear for driven_wheel in self.wheels}

    @property
    def steering(self) -> tuple[str, ...]:
        """The joints that steer."""
        return tuple(pin.joint for pin in self.kingpins)

    def way(self, rolled: Mapping[str, float], steered: Mapping[str, float]) -> PlanarWay:
        """Return the motion of the reference point that fits the wheels best."""
        curvatures = [pin.curvature(pin.turns * steered[pin.joint]) for pin in self.kingpins]
        curvature = fmean(filter(math.isfinite, curvatures)) if any(map(math.isfinite, curvatures)) else 0.0
        # Least squares over all wheels; the outer wheel has the greatest weight.
        shares = {driven_wheel.joint: driven_wheel.way(curvature) for driven_wheel in self.wheels}
        ahead = sum(share * rolled[name] for name, share in shares.items())
        ahead /= sum(share**2 for share in shares.values())
        return PlanarWay(*along(self.heading, ahead, 0.0), curvature * ahead)


_MAX_ANGLE: Final = math.radians(85)  # a wheel at 90 deg to the robot follows no curve

# Used if no limit is stated; cars have 30 to 45 deg.
_ASSUMED_ANGLE: Final = math.radians(45)
STRAIGHT: Final = Wheel("", None, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
"""Replaces the fixed axle if the model has none: at the centre of the base."""


@dataclass(frozen=True, slots=True)
class Kingpin:
    """A steering joint."""

    joint: str  # name of the joint
    ahead: float  # distance in m ahead of the axle that is not steered
    left: float  # distance in m to the left of the base's centre line
    turns: float  # 1 if the joint turns to the left, -1 if its axis points down

    def angle(self, curvature: float) -> float:
        """Return the steering angle to the left in rad for a curvature."""
        return math.atan(curvature * self.ahead / (1 - curvature * self.left))

    def curvature(self, angle: float) -> float:
        """Return the curvature for a steering angle; inf if there is none."""
        tangent = math.tan(angle)
        across = self.ahead + self.left * tangent
        # At a greater angle, the centre of the curve would be on the other side.
        return tangent / across if across * self.ahead > 0 else math.copysign(math.inf, tangent * self.ahead)


@dataclass(frozen=True, slots=True)
class DrivenWheel:
    """A wheel with a motor."""

    joint: str  # name of the joint that turns it
    gear: float  # distance in m that it rolls forward per rad of its joint
    left: float  # distance in m to the left of the base's centre line, with straight wheels
    kingpin: Kingpin | None  # its steering joint; None if it is not steered

    def way(self, curvature: float) -> float:
        """Return the distance that it rolls while the centre of the robot moves 1 m."""
        if self.kingpin is None:
            return 1 - curvature * self.left
        pin = self.kingpin
        beside = self.left - pin.left
        return math.hypot(1 - curvature * pin.left, curvature * pin.ahead) - curvature * beside


def tightest(kingpins: Iterable[Kingpin], limit: float) -> float:
    """Return the curvature in 1/m at which the first wheel reaches `limit` rad, to the left or right."""
    pins = tuple(kingpins)
    return min(abs(pin.curvature(side * limit)) for pin in pins for side in (1, -1))


def steered(kingpins: Iterable[Kingpin], now: float, target: float, most: float) -> float:
    """Return the next curvature towards the target; no wheel turns by more than `most` rad."""
    reached = target
    for pin in kingpins:
        angle, goal = pin.angle(now), pin.angle(target)
        if abs(goal - angle) > most:
            next_one = pin.curvature(angle + math.copysign(most, goal - angle))
            reached = min(reached, next_one, key=lambda curvature: abs(curvature - now))
    return reached


@dataclass(frozen=True, slots=True)
class SteeringLimit:
    """The steering range to either side in rad and the rate in rad/s; `is_assumed` if no range is stated."""

    angle: float
    rate: float
    is_assumed: bool

    @property
    def text(self) -> str:
        """The limits as text."""
        rate = "" if math.isinf(self.rate) else f", {units.display(self.rate, 'rad/s')}"
        assumed = ", assumed" if self.is_assumed else ""
        return f"(up to {units.display(self.angle, 'rad')}{assumed}{rate})"


def limit_of(joints: Sequence[Joint], angle: float | None, rate: float | None) -> SteeringLimit:
    """Return the stated limits, else the smallest limits of the joints."""
    angles = [least for joint in joints if math.isfinite(least := min(-_lower(joint), _upper(joint)))]
    rates = [joint.max_velocity for joint in joints if joint.max_velocity]
    limit = angle or min(angles, default=_ASSUMED_ANGLE)
    return SteeringLimit(min(limit, _MAX_ANGLE), rate or min(rates, default=math.inf), not (angle or angles))


def upright(model: RobotModel, name: str) -> float:
    """Return 1 if a joint turns to the left, -1 if its axis points down."""
    return math.copysign(1.0, wheel(model, name).axis_xyz[2])


def why_not_steering(model: RobotModel, name: str) -> str | None:
    """Return the reason why a joint cannot steer, else None."""
    joint = model.joints_by_name[name]
    if joint.type == "prismatic" or abs(wheel(model, name).axis_xyz[2]) < MIN_UPRIGHT_Z:
        return f"joint '{name}' does not turn about an upright axis: it cannot steer"
    if not _lower(joint) < 0 < _upper(joint):
        return f"joint '{name}' cannot steer: its limits must allow 0 and angles to both sides"
    return None


def _lower(joint: Joint) -> float:
    return -math.inf if joint.lower is None else joint.lower


def _upper(joint: Joint) -> float:
    return math.inf if joint.upper is None else joint.upper
