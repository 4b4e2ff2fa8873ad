"""Where a body of the world is over time: `path: [{at: 0 s, x: 0}, {at: 2 s, x: 1}]`."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Self

from pydantic import Field

from sim_action.core.field_types import Coordinate, FrozenModel, NonNegativeSeconds, Placement, Radians
from sim_action.core.geometry import Pose, quaternion_from_rpy


class PathPoint(FrozenModel):
    """Where a body is at one time, in the world frame; a key that is left out stays as it was."""

    at: Annotated[NonNegativeSeconds, Field(description="sim time; each point is later than the one before")]
    x: Coordinate | None = None
    y: Coordinate | None = None
    z: Coordinate | None = None
    roll: Radians | None = None
    pitch: Radians | None = None
    yaw: Annotated[Radians | None, Field(description="it turns as far as is written: 360 deg is one turn")] = None

    def after(self, before: Placement) -> Placement:
        """Where it puts a body that was there before."""
        stated = self.model_dump(exclude={"at"}, exclude_none=True)
        return before.model_copy(update=stated)


def placements(start: Placement, points: Sequence[PathPoint]) -> tuple[Placement, ...]:
    """One for each point."""
    found: list[Placement] = []
    for point in points:
        found.append(point.after(found[-1] if found else start))
    return tuple(found)


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
