"""Ackermann geometry and steering joints: all wheel axles meet in the centre of the curve.

A curve is given by its curvature in 1/m, positive to the left: turn rate over forward speed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final

from sim_action.core import units
from sim_action.core.records import dataclass
from sim_action.drives.wheels import MIN_UPRIGHT_Z, Wheel, wheel
from sim_action.robot.model.robot_model import Joint, RobotModel

# A wheel at 90 deg to the robot follows no curve.
_MAX_ANGLE: Final = math.radians(85)

# Used if no limit is stated; cars have 30 to 45 deg.
_ASSUMED_ANGLE: Final = math.radians(45)
STRAIGHT: Final = Wheel("", None, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
"""Replaces the fixed axle if the model has none: at the centre of the base."""


@dataclass(frozen=True, slots=True)
class Kingpin:
    """A steering joint.

    Attributes:
        joint: name of the joint.
        ahead: distance in m ahead of the axle that is not steered.
        left: distance in m to the left of the base's centre line.
        turns: 1 if the joint turns to the left, -1 if its axis points down.
    """

    joint: str
    ahead: float
    left: float
    turns: float

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
    """A wheel with a motor.

    Attributes:
        joint: name of the joint that turns it.
        gear: distance in m that it rolls forward per rad of its joint.
        left: distance in m to the left of the base's centre line, with straight wheels.
        kingpin: its steering joint; None if it is not steered.
    """

    joint: str
    gear: float
    left: float
    kingpin: Kingpin | None

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


def steered(kingpins: Iterable[Kingpin], now: float, wanted: float, most: float) -> float:
    """Return the next curvature towards the wanted one; no wheel turns by more than `most` rad."""
    reached = wanted
    for pin in kingpins:
        angle, goal = pin.angle(now), pin.angle(wanted)
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
    told = angle or min(angles, default=_ASSUMED_ANGLE)
    return SteeringLimit(min(told, _MAX_ANGLE), rate or min(rates, default=math.inf), not (angle or angles))


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
