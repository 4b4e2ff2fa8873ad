"""The geometry of steered wheels: all axles meet in one point, the middle of the curve.

A curve is told by its curvature in 1/m, positive to the left: turning rate over forward speed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass


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
