"""How driven wheels and steering move a robot."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from statistics import fmean

from sim_action.drives.heading import along
from sim_action.drives.steering import DrivenWheel, Kingpin
from sim_action.state.wheel_motion import PlanarWay


@dataclass(frozen=True)
class AckermannWays:
    """The inverse of `ackermann_motion`: how far by the driven wheels, which way by the steering.

    Attributes:
        heading: rad, of forward from the base's x axis.
    """

    kingpins: tuple[Kingpin, ...]
    wheels: tuple[DrivenWheel, ...]
    heading: float
    middle_xy: tuple[float, float]

    @property
    def gears(self) -> Mapping[str, float]:
        """See WheelMotion.gears."""
        return {found.joint: found.gear for found in self.wheels}

    @property
    def steering(self) -> tuple[str, ...]:
        """See WheelMotion.steering."""
        return tuple(pin.joint for pin in self.kingpins)

    def way(self, rolled: Mapping[str, float], steered: Mapping[str, float]) -> PlanarWay:
        """See WheelMotion.way."""
        curvatures = [pin.curvature(pin.turns * steered[pin.joint]) for pin in self.kingpins]
        curvature = fmean(filter(math.isfinite, curvatures)) if any(map(math.isfinite, curvatures)) else 0.0
        # Least squares: of wheels that roll on one axle, all have a say, the outer one the most.
        shares = {found.joint: found.way(curvature) for found in self.wheels}
        ahead = sum(share * rolled[name] for name, share in shares.items())
        ahead /= sum(share**2 for share in shares.values())
        return PlanarWay(*along(self.heading, ahead, 0.0), curvature * ahead)
