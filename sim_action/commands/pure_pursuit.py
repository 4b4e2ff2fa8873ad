"""The geometry of pure pursuit: a point of the path some way ahead, and the arc that leads there.

R. C. Coulter, Implementation of the Pure Pursuit Path Tracking Algorithm, CMU-RI-TR-92-01, 1992. Points are (x, y)
in m, curvatures in 1/m, positive to the left.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

Point = tuple[float, float]

# In m: what is no further apart is the same place.
_ROUNDING: Final = 1e-9


@dataclass(frozen=True, slots=True)
class Leg:
    """A straight piece of the path, in the world frame."""

    start: Point
    end: Point

    @property
    def length(self) -> float:
        """In m."""
        return math.dist(self.start, self.end)

    @property
    def direction(self) -> float:
        """Where it leads, in rad from the world's x axis."""
        return math.atan2(self.end[1] - self.start[1], self.end[0] - self.start[0])

    def closest(self, point: Point) -> Point:
        """Its point that is the closest to another."""
        along, _ = self._foot(point)
        return self._at(along)

    def lookahead_point(self, point: Point, lookahead: float) -> Point:
        """Where to head for: from the closest point on, the first that is `lookahead` m away; the end if none is."""
        along, beside = self._foot(point)
        return self._at(along + math.sqrt(max(0.0, lookahead**2 - beside**2)))

    def _foot(self, point: Point) -> Point:
        """How far along the leg, and how far left of it, a point is, in m; before its start is negative."""
        return seen_from(self.start, self.direction, point)

    def _at(self, along: float) -> Point:
        if along <= 0 or along >= self.length:
            return self.start if along <= 0 else self.end
        share = along / self.length
        (x, y), (end_x, end_y) = self.start, self.end
        return (x + share * (end_x - x), y + share * (end_y - y))


def seen_from(place: Point, heading: float, point: Point) -> Point:
    """How far ahead and how far left of a robot a point is, in m; `heading`: rad from the world's x axis."""
    x, y = point[0] - place[0], point[1] - place[1]
    cosine, sine = math.cos(heading), math.sin(heading)
    return (cosine * x + sine * y, cosine * y - sine * x)


def curvature_to(ahead: float, left: float, before_axle: float = 0.0) -> float:
    """The curvature of the arc that takes a robot from where it is to a point.

    `before_axle`: m by which what is to come there is before the axle, amid whose line the arcs of both have their
    centre. With 0 it is Coulter's: 2 left / distance^2.
    """
    chord = ahead**2 + left**2 + 2 * before_axle * ahead
    return 2 * left / chord if chord > _ROUNDING**2 else 0.0


def turns(legs: Sequence[Leg]) -> list[float]:
    """By how much the path turns at the end of each leg, in rad without sign; the last is left out."""
    return [abs(math.remainder(after.direction - leg.direction, math.tau)) for leg, after in pairwise(legs)]


def braking_speed(distance: float, deceleration: float) -> float:
    """The speed, or turning rate, from which one that slows down evenly comes to rest after a distance, or angle."""
    return math.sqrt(2 * deceleration * distance)
