"""The inputs of sensors besides the observed state: queries to the engine, and the motion that wheels give the base.

Wheels do not slip here, and nothing is measured with an error.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Protocol

from sim_action.core.geometry import Pose, Twist, Vector3, quaternion_from_rpy
from sim_action.core.lazy_numpy import NDArray, np
from sim_action.core.records import dataclass


class EngineQueries(Protocol):
    """The queries of sensors to a physics engine; none of them changes the run."""

    def link_pose(self, link: str) -> Pose:
        """Return the pose of a link's frame in the world; the frame is not the centre of mass."""

    def link_twist(self, link: str) -> Twist:
        """Return the twist of the origin of a link's frame, in the world frame."""

    def body_pose(self, body: str) -> Pose:
        """Return the pose of the centre of a body of the world, by name; the ground has none."""

    def cast_rays(self, start_xyz: Vector3, ends_xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        """Cast rays that hit the bodies of the world and the ground, but never the robot.

        A body around `start_xyz` is not hit: rays see surfaces from outside only.

        Returns:
            (N,) the fraction of each ray, 0 to 1, at which it hits a surface; inf: no hit.

        `start_xyz`: the start of all rays, in m, world frame; `ends_xyz`: (N, 3) the ends of the rays, in m, world
        frame.
        """


@dataclass(frozen=True, slots=True)
class PlanarWay:
    """A motion of a point of the base along an arc on the ground, in the axes of the turning base."""

    x: float  # x, y: the distance in m along the axes of the base, summed along the arc
    y: float
    turn: float  # the turn to the left in rad

    def of_point(self, x: float, y: float) -> PlanarWay:
        """Return the motion of the point of the base that is at (x, y) m from this one."""
        return PlanarWay(self.x - self.turn * y, self.y + self.turn * x, self.turn)

    def pose(self) -> Pose:
        """Return the end pose, seen from the start pose. Exact: the chord of an arc points in its mean direction."""
        # The watchdog reports a state that is not finite.
        turn = self.turn if math.isfinite(self.turn) else math.nan
        half = turn / 2
        chord = math.sin(half) / half if half else 1.0
        cosine, sine = chord * math.cos(half), chord * math.sin(half)
        position = (cosine * self.x - sine * self.y, sine * self.x + cosine * self.y, 0.0)
        return Pose(position, quaternion_from_rpy(0.0, 0.0, turn))

    def twist(self, duration: float) -> Twist:
        """Return the velocity that makes this motion in `duration` s, in the frame of the base."""
        return Twist((self.x / duration, self.y / duration, 0.0), (0.0, 0.0, self.turn / duration))


class WheelMotion(Protocol):
    """The relation between the wheels of a robot and the motion of its base."""

    @property
    def gears(self) -> Mapping[str, float]:
        """The rolling distance in m for 1 rad of each wheel joint."""

    @property
    def steering(self) -> tuple[str, ...]:
        """The joints that steer."""

    @property
    def middle_xy(self) -> tuple[float, float]:
        """The reference point of the motion in m, base frame: the centre of a turn on the spot."""

    def way(self, rolled: Mapping[str, float], steered: Mapping[str, float]) -> PlanarWay:
        """Return the motion of the reference point."""
