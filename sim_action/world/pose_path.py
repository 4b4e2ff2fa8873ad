"""A pose that moves through others over time."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose, quaternion_from_rpy
from sim_action.world.timed_path import PathPoint, placements

Numbers = tuple[float, float, float, float, float, float]
"""x, y, z in m and roll, pitch, yaw in rad."""


@dataclass(frozen=True, slots=True)
class PosePath:
    """Each of the six numbers of a pose goes from point to point along a straight line, angles as far as is written.

    Attributes:
        times: of the points, in s, rising.
        points: at those times.
        loops: whether it begins again at its end, where it is where it began; else it stays.
    """

    times: tuple[float, ...]
    points: tuple[Numbers, ...]
    loops: bool = False

    @classmethod
    def of(cls, start: Placement, points: Sequence[PathPoint], *, loops: bool = False) -> Self:
        """The path of a body; `start` tells what its points leave out."""
        numbers = tuple((p.x, p.y, p.z or 0.0, p.roll, p.pitch, p.yaw) for p in placements(start, points))
        return cls(tuple(point.at for point in points), numbers, loops)

    def numbers(self, time: float) -> Numbers:
        """At a time in s; before the first point it is there."""
        first, last = self.times[0], self.times[-1]
        if self.loops and time > last:
            time = first + (time - first) % (last - first)
        after = bisect_right(self.times, time)
        if after == 0:
            return self.points[0]
        if after == len(self.times):
            return self.points[-1]
        begins, ends = self.times[after - 1], self.times[after]
        share = (time - begins) / (ends - begins)
        x, y, z, roll, pitch, yaw = (
            one + (other - one) * share for one, other in zip(self.points[after - 1], self.points[after], strict=True)
        )
        return x, y, z, roll, pitch, yaw

    def pose(self, time: float) -> Pose:
        """At a time in s, in the world frame."""
        x, y, z, roll, pitch, yaw = self.numbers(time)
        return Pose((x, y, z), quaternion_from_rpy(roll, pitch, yaw))
