"""A path on the ground, and how far along it something is that only ever goes on along it."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Final, NamedTuple, Self

Point = tuple[float, float]

# Pieces of a curve between two points.
_PIECES: Final = 16


class Foot(NamedTuple):
    """A place on a path: how far along it, and how far from what is projected onto it, both in m."""

    along: float
    distance: float


@dataclass(frozen=True)
class ReferencePath:
    """Straight pieces from point to point, none of them of length 0."""

    points: tuple[Point, ...]

    @cached_property
    def lengths(self) -> tuple[float, ...]:
        """In m, of the path up to each point."""
        lengths = [0.0]
        for before, after in pairwise(self.points):
            lengths.append(lengths[-1] + math.dist(before, after))
        return tuple(lengths)

    @property
    def length(self) -> float:
        """In m."""
        return self.lengths[-1]

    def foot(self, place: Point, begin: float, end: float) -> Foot:
        """The nearest place of the path between two of its lengths, in m; of several, the first."""
        best = Foot(begin, math.inf)
        piece = max(0, min(bisect_left(self.lengths, begin) - 1, len(self.points) - 2))
        while True:
            found = self._foot_on(piece, place, begin, end)
            if found.distance < best.distance:
                best = found
            piece += 1
            if piece > len(self.points) - 2 or self.lengths[piece] > end:
                return best

    def _foot_on(self, piece: int, place: Point, begin: float, end: float) -> Foot:
        (x, y), (end_x, end_y), start = self.points[piece], self.points[piece + 1], self.lengths[piece]
        length = self.lengths[piece + 1] - start
        ahead_x, ahead_y = (end_x - x) / length, (end_y - y) / length
        along = (place[0] - x) * ahead_x + (place[1] - y) * ahead_y
        along = min(max(along, begin - start, 0.0), end - start, length)
        distance = math.hypot(place[0] - x - along * ahead_x, place[1] - y - along * ahead_y)
        return Foot(start + along, distance)


def smoothed(points: Sequence[Point]) -> list[Point]:
    """A curve through the points without corners, as straight pieces (centripetal Catmull-Rom).

    E. Catmull and R. Rom, A Class of Local Interpolating Splines, 1974; its parameters as C. Yuksel, S. Schaefer and
    J. Keyser, Parameterization and Applications of Catmull-Rom Curves, 2011, have them: without loops and cusps.
    """
    if len(points) < 3:
        return list(points)
    before, after = _mirrored(points[1], points[0]), _mirrored(points[-2], points[-1])
    around = [before, *points, after]
    curve = [points[0]]
    for index in range(len(points) - 1):
        curve += _arc(around[index : index + 4])
    return curve


def _mirrored(point: Point, about: Point) -> Point:
    return (2 * about[0] - point[0], 2 * about[1] - point[1])


def _arc(four: Sequence[Point]) -> list[Point]:
    """From the second of four points to the third, the second left out."""
    knots = [0.0]
    for one, other in pairwise(four):
        knots.append(knots[-1] + math.sqrt(math.dist(one, other)))
    times = (knots[1] + (knots[2] - knots[1]) * part / _PIECES for part in range(1, _PIECES))
    return [*(_at(time, four, knots) for time in times), four[2]]


def _at(time: float, points: Sequence[Point], knots: Sequence[float]) -> Point:
    """By the pyramid of P. J. Barry and R. N. Goldman, 1988."""
    # Which knots each of the three rows above the points interpolates between.
    for spans in (((0, 1), (1, 2), (2, 3)), ((0, 2), (1, 3)), ((1, 2),)):
        shares = ((time - knots[first]) / (knots[last] - knots[first]) for first, last in spans)
        points = [_between(*pair, share) for pair, share in zip(pairwise(points), shares, strict=True)]
    return points[0]


def _between(one: Point, other: Point, share: float) -> Point:
    return (one[0] + share * (other[0] - one[0]), one[1] + share * (other[1] - one[1]))


# How far along the path the robot may have come at most, as a share of what it moved and was away: as far as a corner
# that it cuts leads.
_PER_DISTANCE: Final = 2.0


@dataclass(frozen=True, slots=True)
class Progress:
    """How far along its path something has come.

    Attributes:
        place: where it is, in m.
        foot: where on the path that is.
    """

    path: ReferencePath
    place: Point
    foot: Foot

    @classmethod
    def at_start(cls, path: ReferencePath, place: Point) -> Self:
        """Before the first step."""
        return cls(path, place, Foot(0.0, math.dist(place, path.points[0])))

    def to(self, place: Point) -> Self:
        """After a step to a place."""
        along, distance = self.foot
        ahead = _PER_DISTANCE * (distance + math.dist(place, self.place))
        return type(self)(self.path, place, self.path.foot(place, along, min(along + ahead, self.path.length)))

    @property
    def remaining(self) -> float:
        """How far it is to the end in m: along the path, or straight if that is more."""
        return max(self.path.length - self.foot.along, math.dist(self.place, self.path.points[-1]))
