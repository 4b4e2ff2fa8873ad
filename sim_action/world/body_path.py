"""The path of a body of the world: `path: [{at: 0 s, x: 0}, {at: 2 s, x: 1}]`."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Final, Self

from pydantic import Field

from sim_action.core.field_types import Coordinate, FrozenModel, NonNegativeSeconds, Placement, Radians
from sim_action.core.geometry import Pose, quaternion_from_rpy
from sim_action.core.records import dataclass

MAX_PACE: Final = 100.0  # the greatest multiple of the speed that a path states


class PathPoint(FrozenModel):
    """The pose of a body at one time, world frame; missing keys keep their last value."""

    at: Annotated[NonNegativeSeconds, Field(description="sim time; must be later than that of the previous point")]
    x: Coordinate | None = None
    y: Coordinate | None = None
    z: Coordinate | None = None
    roll: Radians | None = None
    pitch: Radians | None = None
    yaw: Annotated[Radians | None, Field(description="absolute angle, not wrapped: 360 deg is one full turn")] = None

    def after(self, before: Placement) -> Placement:
        """Return the placement at this point, given the previous one."""
        stated = self.model_dump(exclude={"at"}, exclude_none=True)
        return before.model_copy(update=stated)


class Pace(FrozenModel):
    """A change of the speed along a path, which then lasts longer or shorter, or stops."""

    at: Annotated[NonNegativeSeconds, Field(description="sim time of the change")]
    speed: Annotated[
        float, Field(ge=0, le=MAX_PACE, description="speed from then on, as a multiple of the stated one; 0: it stops")
    ]


def placements(start: Placement, points: Sequence[PathPoint]) -> tuple[Placement, ...]:
    """Return the placement at each point."""
    found: list[Placement] = []
    for point in points:
        found.append(point.after(found[-1] if found else start))
    return tuple(found)


Numbers = tuple[float, float, float, float, float, float]  # x, y, z in m and roll, pitch, yaw in rad


@dataclass(frozen=True, slots=True)
class PosePath:
    """A pose over time. Each of its six numbers is interpolated linearly; angles are not wrapped."""

    times: tuple[float, ...]  # of the points in s, ascending
    points: tuple[Numbers, ...]  # the numbers at those times
    loops: bool = False  # True if the path repeats; otherwise the pose stays at the last point
    # the changes of the speed along the path: sim time in s, and a multiple of the stated speed
    pace: tuple[Pace, ...] = ()

    @classmethod
    def of(
        cls, start: Placement, points: Sequence[PathPoint], *, loops: bool = False, pace: tuple[Pace, ...] = ()
    ) -> Self:
        """Return the path of a body; `start` gives the keys that its points omit."""
        numbers = tuple((p.x, p.y, p.z or 0.0, p.roll, p.pitch, p.yaw) for p in placements(start, points))
        return cls(tuple(point.at for point in points), numbers, loops, pace)

    def numbers(self, time: float) -> Numbers:
        """Return the numbers at a time in s; before the first point, those of the first point."""
        if self.pace:
            time = self._along(time)
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

    def _along(self, time: float) -> float:
        """Return the time in s of the path at a sim time in s."""
        along, since, speed = 0.0, 0.0, 1.0
        for change in self.pace:
            if change.at >= time:
                break
            along, since, speed = along + (change.at - since) * speed, change.at, change.speed
        return along + (time - since) * speed

    def pose(self, time: float) -> Pose:
        """Return the pose at a time in s, world frame."""
        x, y, z, roll, pitch, yaw = self.numbers(time)
        return Pose((x, y, z), quaternion_from_rpy(roll, pitch, yaw))

    def fastest(self, reach: float) -> tuple[float, float]:
        """Return upper bounds in m/s and rad/s on the speed of points up to `reach` m from the origin, and on turns."""
        speed = turn = 0.0
        for (begins, one), (ends, other) in pairwise(zip(self.times, self.points, strict=True)):
            ways = [abs(after - before) / (ends - begins) for before, after in zip(one, other, strict=True)]
            speed, turn = max(speed, math.hypot(*ways[:3])), max(turn, sum(ways[3:]))
        most = max([1.0, *(change.speed for change in self.pace)])
        return most * (speed + turn * reach), most * turn
