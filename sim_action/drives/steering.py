"""The geometry of steered wheels: all axles meet in one point, the middle of the curve.

A curve is told by its curvature in 1/m, positive to the left: turning rate over forward speed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from sim_action.core import units
from sim_action.drives.wheels import Wheel, wheel
from sim_action.robot.robot_model import Joint, RobotModel

# Of a unit vector: from here on, an axis is taken for upright.
_UPRIGHT: Final = 0.8

# In rad: a wheel at right angles to the robot leads on no curve.
_MOST: Final = math.radians(85)

# In rad, where nobody says: that of a car is 30 to 45 deg.
_ASSUMED: Final = math.radians(45)
STRAIGHT: Final = Wheel("", None, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
"""Stands for the fixed axle where the model has none: amid the base."""


@dataclass(frozen=True, slots=True)
class Kingpin:
    """A steering joint.

    Attributes:
        joint: its name.
        ahead: m, of the axle that is not steered.
        left: m, of the base's middle line.
        turns: 1 if its joint turns to the left, -1 if its axis points down.
    """

    joint: str
    ahead: float
    left: float
    turns: float

    def angle(self, curvature: float) -> float:
        """By how much the wheel has to be turned to the left, in rad."""
        return math.atan(curvature * self.ahead / (1 - curvature * self.left))

    def curvature(self, angle: float) -> float:
        """The curve on which the wheel is turned by an angle; inf if on none."""
        tangent = math.tan(angle)
        across = self.ahead + self.left * tangent
        # Beyond that, the middle of the curve would be on the other side.
        return tangent / across if across * self.ahead > 0 else math.copysign(math.inf, tangent * self.ahead)


@dataclass(frozen=True, slots=True)
class DrivenWheel:
    """A wheel with a motor.

    Attributes:
        joint: the joint that turns it.
        gear: m that it rolls forward while its joint turns by 1 rad.
        left: m, of the base's middle line, with straight wheels.
        kingpin: of its steering joint; None if it is not steered.
    """

    joint: str
    gear: float
    left: float
    kingpin: Kingpin | None

    def way(self, curvature: float) -> float:
        """How far it rolls while the robot's middle goes 1 m."""
        if self.kingpin is None:
            return 1 - curvature * self.left
        pin = self.kingpin
        beside = self.left - pin.left
        return math.hypot(1 - curvature * pin.left, curvature * pin.ahead) - curvature * beside


def tightest(kingpins: Iterable[Kingpin], limit: float) -> float:
    """The curvature, in 1/m, at which the first of the wheels is turned by `limit` rad, to the left as to the right."""
    pins = tuple(kingpins)
    return min(abs(pin.curvature(side * limit)) for pin in pins for side in (1, -1))


def steered(kingpins: Iterable[Kingpin], now: float, wanted: float, most: float) -> float:
    """The curvature after a step in which no wheel is turned by more than `most` rad, on its way to the wanted one."""
    reached = wanted
    for pin in kingpins:
        angle, goal = pin.angle(now), pin.angle(wanted)
        if abs(goal - angle) > most:
            next_one = pin.curvature(angle + math.copysign(most, goal - angle))
            reached = min(reached, next_one, key=lambda curvature: abs(curvature - now))
    return reached


@dataclass(frozen=True, slots=True)
class SteeringLimit:
    """How far steering goes to either side, in rad, and how fast, in rad/s; `is_assumed`: nobody says how far."""

    angle: float
    rate: float
    is_assumed: bool

    @property
    def text(self) -> str:
        """In words."""
        rate = "" if math.isinf(self.rate) else f", {units.display(self.rate, 'rad/s')}"
        assumed = ", assumed" if self.is_assumed else ""
        return f"(up to {units.display(self.angle, 'rad')}{assumed}{rate})"


def limit_of(joints: Sequence[Joint], angle: float | None, rate: float | None) -> SteeringLimit:
    """What is stated, or else the least that the joints say."""
    angles = [least for joint in joints if math.isfinite(least := min(-_lower(joint), _upper(joint)))]
    rates = [joint.max_velocity for joint in joints if joint.max_velocity]
    told = angle or min(angles, default=_ASSUMED)
    return SteeringLimit(min(told, _MOST), rate or min(rates, default=math.inf), not (angle or angles))


def upright(model: RobotModel, name: str) -> float:
    """1 if a joint turns to the left, -1 if its axis points down."""
    return math.copysign(1.0, wheel(model, name).axis_xyz[2])


def why_not_steering(model: RobotModel, name: str) -> str | None:
    """What to say of a joint that cannot steer; None if it can."""
    joint = model.joints_by_name[name]
    if joint.type == "prismatic" or abs(wheel(model, name).axis_xyz[2]) < _UPRIGHT:
        return f"joint '{name}' does not turn about an upright axis: it steers nothing"
    if not _lower(joint) < 0 < _upper(joint):
        return f"joint '{name}' cannot be straight and turn to both sides within its limits"
    return None


def _lower(joint: Joint) -> float:
    return -math.inf if joint.lower is None else joint.lower


def _upper(joint: Joint) -> float:
    return math.inf if joint.upper is None else joint.upper
