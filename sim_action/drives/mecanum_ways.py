"""How mecanum wheels move a robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from sim_action.drives.heading import along
from sim_action.drives.mecanum_motion import Roller
from sim_action.state.wheel_motion import PlanarWay


@dataclass(frozen=True)
class MecanumWays:
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
