"""Joints that steer: how far and how fast they turn, and which way."""

from __future__ import annotations

import math
from collections.abc import Sequence
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
