"""How two sides of wheels move a robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import fsum

from sim_action.drives.heading import along
from sim_action.state.wheel_motion import PlanarWay


@dataclass(frozen=True)
class SidedWays:
    """The inverse of `sided_motion`.

    Attributes:
        left, right: joints of the wheels.
        separation: m, as it is in effect.
        heading: rad, of forward from the base's x axis.
    """

    gears: Mapping[str, float]
    left: tuple[str, ...]
    right: tuple[str, ...]
    separation: float
    heading: float
    middle_xy: tuple[float, float]
    steering: tuple[str, ...] = ()

    def way(self, rolled: Mapping[str, float], steered: Mapping[str, float]) -> PlanarWay:
        """See WheelMotion.way."""
        left, right = (fsum(rolled[name] for name in side) / len(side) for side in (self.left, self.right))
        return PlanarWay(*along(self.heading, (left + right) / 2, 0.0), (right - left) / self.separation)
