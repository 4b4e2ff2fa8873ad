"""The inputs of sensors besides the observed state: queries to the engine, and the motion that wheels give the base.

Wheels do not slip here, and nothing is measured with an error.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from sim_action.core.geometry import Pose, Twist, Vector3, quaternion_from_rpy

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class EngineQueries(Protocol):
    """An engine, as sensors see it."""

    def link_pose(self, link: str) -> Pose:
        """Of a link's frame, which is not its centre of mass, in the world."""

    def link_twist(self, link: str) -> Twist:
        """Of the origin of a link's frame, in the world frame."""

    def body_pose(self, body: str) -> Pose:
        """Of the middle of a body of the world, by its name; not of the ground."""

    def cast_rays(self, start_xyz: Vector3, ends_xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        """Casts rays that meet the bodies of the world and the ground, and never the robot.

        What `start_xyz` is inside of is not met, either: rays see surfaces from outside.

        Args:
            start_xyz: where all of them begin, in m, world frame.
            ends_xyz: (N, 3) where they end, in m, world frame.

        Returns:
            (N,) the share of its way, 0 to 1, after which each ray meets a surface; inf: it meets none.
        """


@dataclass(frozen=True, slots=True)
class PlanarWay:
    """A way over the ground on an arc: how far a point of the base goes, as seen from the base, while that turns.

    Attributes:
        x, y: m along the axes of the base, added up on the way.
        turn: rad to the left.
    """

    x: float
    y: float
    turn: float

    def of_point(self, x: float, y: float) -> PlanarWay:
        """The way of the point of the base that is at (x, y) m of this one."""
        return PlanarWay(self.x - self.turn * y, self.y + self.turn * x, self.turn)

    def pose(self) -> Pose:
        """Where it leads to, seen from where it begins. Exact: an arc is its chord, half-way turned."""
        # Of a state that is not finite nothing is known; the watchdog tells of it.
        turn = self.turn if math.isfinite(self.turn) else math.nan
        half = turn / 2
        chord = math.sin(half) / half if half else 1.0
        cosine, sine = chord * math.cos(half), chord * math.sin(half)
        position = (cosine * self.x - sine * self.y, sine * self.x + cosine * self.y, 0.0)
        return Pose(position, quaternion_from_rpy(0.0, 0.0, turn))

    def twist(self, duration: float) -> Twist:
        """The velocity at which it takes so many seconds, in the frame of the base."""
        return Twist((self.x / duration, self.y / duration, 0.0), (0.0, 0.0, self.turn / duration))


class WheelMotion(Protocol):
    """How the wheels of a robot move it."""

    @property
    def gears(self) -> Mapping[str, float]:
        """Joint of a wheel -> m that it rolls forward while the joint turns by 1 rad."""

    @property
    def steering(self) -> tuple[str, ...]:
        """Joints that steer."""

    @property
    def middle_xy(self) -> tuple[float, float]:
        """The point whose way is told, in m, base frame: what the robot turns about where it turns on the spot."""

    def way(self, rolled: Mapping[str, float], steered: Mapping[str, float]) -> PlanarWay:
        """Of that point. `rolled`: joint of a wheel -> m forward; `steered`: joint -> its mean position in rad."""
