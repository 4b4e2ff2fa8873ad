"""A reference path on the ground or in space, and the progress of a robot along it, which never goes back."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from typing import Final, NamedTuple, Self

from sim_action.core.records import dataclass

Point = tuple[float, ...]
"""Two coordinates on the ground plane, or three in space, in m."""

# Segments of a curve between two points.
_PIECES: Final = 16


class Foot(NamedTuple):
    """The projection of a point onto a path: its arc length and its distance, both in m."""

    along: float
    distance: float


@dataclass(frozen=True)
class ReferencePath:
    """A polyline whose segments all have a length greater than 0."""

    points: tuple[Point, ...]

    @cached_property
    def lengths(self) -> tuple[float, ...]:
        """Arc length of each point in m."""
        lengths = [0.0]
        for before, after in pairwise(self.points):
            lengths.append(lengths[-1] + math.dist(before, after))
        return tuple(lengths)

    @property
    def length(self) -> float:
        """Length of the whole path in m."""
        return self.lengths[-1]

    def foot(self, place: Point, begin: float, end: float) -> Foot:
        """Return the closest point of the path between two arc lengths in m; of several, the first."""
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
        if len(place) == 3:
            return self._foot_in_space(piece, place, begin, end)
        (x, y), (end_x, end_y), start = self.points[piece], self.points[piece + 1], self.lengths[piece]
        length = self.lengths[piece + 1] - start
        ahead_x, ahead_y = (end_x - x) / length, (end_y - y) / length
        along = (place[0] - x) * ahead_x + (place[1] - y) * ahead_y
        along = min(max(along, begin - start, 0.0), end - start, length)
        distance = math.hypot(place[0] - x - along * ahead_x, place[1] - y - along * ahead_y)
        return Foot(start + along, distance)

    def _foot_in_space(self, piece: int, place: Point, begin: float, end: float) -> Foot:
        at, start = self.points[piece], self.lengths[piece]
        length = self.lengths[piece + 1] - start
        ahead = [(to - here) / length for here, to in zip(at, self.points[piece + 1], strict=True)]
        away = [to - here for here, to in zip(at, place, strict=True)]
        along = away[0] * ahead[0] + away[1] * ahead[1] + away[2] * ahead[2]
        along = min(max(along, begin - start, 0.0), end - start, length)
        return Foot(start + along, math.hypot(*(to - along * unit for to, unit in zip(away, ahead, strict=True))))


def smoothed(points: Sequence[Point]) -> list[Point]:
    """Return a polyline along a centripetal Catmull-Rom curve through the points.

    E. Catmull and R. Rom, A Class of Local Interpolating Splines, 1974. The parametrisation is that of C. Yuksel, S.
    Schaefer and J. Keyser, Parameterization and Applications of Catmull-Rom Curves, 2011: without loops and cusps.
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
    return tuple(2 * middle - at for middle, at in zip(about, point, strict=True))


def _arc(four: Sequence[Point]) -> list[Point]:
    """Return the curve from the second of four points to the third, without the second."""
    knots = [0.0]
    for one, other in pairwise(four):
        knots.append(knots[-1] + math.sqrt(math.dist(one, other)))
    times = (knots[1] + (knots[2] - knots[1]) * part / _PIECES for part in range(1, _PIECES))
    return [*(_at(time, four, knots) for time in times), four[2]]


def _at(time: float, points: Sequence[Point], knots: Sequence[float]) -> Point:
    """Return a point of the curve, by the pyramid of P. J. Barry and R. N. Goldman, 1988."""
    # The knots between which each of the three rows above the points interpolates.
    for spans in (((0, 1), (1, 2), (2, 3)), ((0, 2), (1, 3)), ((1, 2),)):
        shares = ((time - knots[first]) / (knots[last] - knots[first]) for first, last in spans)
        points = [_between(*pair, share) for pair, share in zip(pairwise(points), shares, strict=True)]
    return points[0]


def _between(one: Point, other: Point, share: float) -> Point:
    return tuple(here + share * (there - here) for here, there in zip(one, other, strict=True))


# Maximum progress per step, relative to motion plus error: enough for a corner that the robot cuts.
_MAX_PROGRESS_RATIO: Final = 2.0


@dataclass(frozen=True, slots=True)
class Progress:
    """The progress of a robot along a path.

    Attributes:
        place: position of the robot in m.
        foot: projection of the position onto the path.
    """

    path: ReferencePath
    place: Point
    foot: Foot

    @classmethod
    def at_start(cls, path: ReferencePath, place: Point) -> Self:
        """Return the progress before the first step."""
        return cls(path, place, Foot(0.0, math.dist(place, path.points[0])))

    def to(self, place: Point) -> Self:
        """Return the progress after the robot moved to a position."""
        along, distance = self.foot
        ahead = _MAX_PROGRESS_RATIO * (distance + math.dist(place, self.place))
        return type(self)(self.path, place, self.path.foot(place, along, min(along + ahead, self.path.length)))

    @property
    def remaining(self) -> float:
        """Distance to the end of the path in m: along the path or straight, whichever is greater."""
        return max(self.path.length - self.foot.along, math.dist(self.place, self.path.points[-1]))
