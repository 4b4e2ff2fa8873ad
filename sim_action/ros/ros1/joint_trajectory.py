"""Trajectories of joints as trajectory_msgs has them: points at times, and curves between them."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise


@dataclass(frozen=True, slots=True)
class Waypoint:
    """Where a joint is to be at a time in s, in rad (or m), and how fast, if that is said, in rad/s (or m/s)."""

    time: float
    position: float
    velocity: float | None = None


@dataclass(frozen=True, slots=True)
class JointCurve:
    """The way of one joint; `points`: in rising time, at least one. Before the first and after the last, it rests."""

    points: tuple[Waypoint, ...]

    def at(self, time: float) -> tuple[float, float]:
        """Position and velocity."""
        after = bisect_left([point.time for point in self.points], time)
        if after == 0:
            return self.points[0].position, 0.0
        if after == len(self.points):
            return self.points[-1].position, 0.0
        first, last = self.points[after - 1 : after + 1]
        if first.velocity is None or last.velocity is None:
            return _straight(first, last, time)
        return _cubic(first, first.velocity, last, last.velocity, time)


def curves(
    names: Sequence[str], start: Sequence[Waypoint], points: Sequence[tuple[float, Sequence[float], Sequence[float]]]
) -> dict[str, JointCurve]:
    """Joint -> its way, from where it is now. `points`: time in s, positions and velocities, the latter maybe empty.

    Points that are in the past are left out. Raises ValueError if none is left, they are not in rising time, or not of
    all joints.
    """
    points = [point for point in points if point[0] > start[0].time]
    times = [time for time, _, _ in points]
    if not points:
        raise ValueError("all of it is in the past")
    if any(later <= earlier for earlier, later in pairwise(times)):
        raise ValueError("its points are not in rising time")
    if any(len(positions) != len(names) or len(speeds) not in (0, len(names)) for _, positions, speeds in points):
        raise ValueError(f"each point has {len(names)} positions, and as many velocities or none")
    return {
        name: JointCurve(
            (
                start[index],
                *(
                    Waypoint(time, positions[index], speeds[index] if speeds else None)
                    for time, positions, speeds in points
                ),
            )
        )
        for index, name in enumerate(names)
    }


def _straight(first: Waypoint, last: Waypoint, time: float) -> tuple[float, float]:
    speed = (last.position - first.position) / (last.time - first.time)
    return first.position + speed * (time - first.time), speed


def _cubic(first: Waypoint, speed: float, last: Waypoint, end_speed: float, time: float) -> tuple[float, float]:
    """Hermite's, from one position and velocity to another."""
    span = last.time - first.time
    part = (time - first.time) / span
    way = last.position - first.position
    a, b = span * speed - way, way - span * end_speed
    # p + s way + s (1 - s) (a (1 - s) + b s), and how that grows with s.
    position = first.position + part * way + part * (1 - part) * (a * (1 - part) + b * part)
    growth = way + (1 - 2 * part) * (a * (1 - part) + b * part) + part * (1 - part) * (b - a)
    return position, growth / span
