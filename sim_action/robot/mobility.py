"""What a robot's drive can do, as whoever plans where the robot goes has to know it."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Mobility:
    """How a robot moves over the ground; left out: as a robot that turns on the spot, about its base link's origin.

    Attributes:
        heading: rad, of forward, from the base's x axis to the left.
        ahead: m, along the heading, of the base link's origin before the axle about which the robot turns.
        tightest: 1/m, the largest curvature that it can drive; inf if it turns on the spot.
        acceleration: m/s^2, limit of the forward speed's change.
        turn_acceleration: rad/s^2, limit of the turning rate's change, where it turns on the spot.
    """

    heading: float = 0.0
    ahead: float = 0.0
    tightest: float = math.inf
    acceleration: float = 1.0
    turn_acceleration: float = 1.0

    @property
    def turns_on_the_spot(self) -> bool:
        """Whether it can turn without driving."""
        return math.isinf(self.tightest)

    @property
    def turning_radius(self) -> float:
        """The smallest, in m."""
        return 1 / self.tightest
