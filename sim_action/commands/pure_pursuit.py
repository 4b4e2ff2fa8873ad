"""The geometry of pure pursuit: a point of the path some way ahead, and the arc that leads there.

R. C. Coulter, Implementation of the Pure Pursuit Path Tracking Algorithm, CMU-RI-TR-92-01, 1992. Points are (x, y)
in m, curvatures in 1/m, positive to the left.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Final

from sim_action.core.geometry import Twist
from sim_action.robot.kinematics import Mobility

if TYPE_CHECKING:
    from sim_action.state.observation import Observation


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


# In rad off its way: from here on a robot turns on the spot, if it can, until it is less than the other.
_FAR_OFF: Final = math.radians(45)
_ALIGNED: Final = math.radians(3)
# Of the tolerance: nearer than that, it has arrived.
_AT_THE_POINT: Final = 0.25
# Of what the drive can do; the rest is for catching up.
_BRAKES: Final = 0.5
_TIGHTEST: Final = 0.99


@dataclass(frozen=True, slots=True)
class Pursuit:
    """How a path is followed: m/s, m, m and rad/s."""

    speed: float
    lookahead: float
    tolerance: float
    max_turn_rate: float


class PathFollower:
    """Goes leg by leg: to the next waypoint, and on once that is passed."""

    def __init__(self, waypoints: Sequence[Point], pursuit: Pursuit, mobility: Mobility) -> None:
        """`waypoints`: in the world frame, one or more."""
        self._waypoints = waypoints
        self._pursuit = pursuit
        self._mobility = mobility
        cuts_corners = not mobility.turns_on_the_spot
        self._passed_within = max(pursuit.lookahead, mobility.turning_radius) if cuts_corners else pursuit.tolerance
        # A waypoint in there that is no longer ahead cannot be driven to, neither forward nor after turning.
        self._out_of_reach = max(mobility.turning_radius, 2 * abs(mobility.ahead))
        self._legs: list[Leg] | None = None
        self._to_stop: list[float] = []
        self._turning = False

    def command(self, seen: Observation) -> Twist:
        """What to do now. To be asked at every tick: it remembers how far it has come."""
        place, heading = seen.pose.position_xyz[:2], seen.pose.yaw + self._mobility.heading
        if self._legs is None:
            self._legs = [Leg(*ends) for ends in pairwise((place, *self._waypoints))]
            self._to_stop = self._distances_to_stop(self._legs)
        while self._legs and self._is_passed(self._legs[0].end, place, heading):
            del self._legs[0], self._to_stop[0]
        if not self._legs:
            return Twist()
        ahead, left = seen_from(place, heading, self._legs[0].lookahead_point(place, self._pursuit.lookahead))
        off = self._off(ahead, left)
        self._turning = self._mobility.turns_on_the_spot and abs(off) > (_ALIGNED if self._turning else _FAR_OFF)
        if self._turning:
            return self._on_the_spot(off)
        return self._along(ahead, left, math.dist(place, self._legs[0].end) + self._to_stop[0])

    @property
    def _before_axle(self) -> float:
        # An origin that trails the axle is best taken for the axle: no arc leads it to what is beside it.
        return max(0.0, self._mobility.ahead)

    def _off(self, ahead: float, left: float) -> float:
        """By how much a point is off the robot's way, in rad to the left."""
        return math.atan2(left, ahead + self._before_axle)

    def _distances_to_stop(self, legs: Sequence[Leg]) -> list[float]:
        """From the end of each leg to where it has to stand still next: at the end, or to turn on the spot."""
        distances = [0.0]
        for leg, turn in zip(reversed(legs[1:]), reversed(turns(legs)), strict=True):
            stops = self._mobility.turns_on_the_spot and turn > _FAR_OFF
            distances.append(0.0 if stops else distances[-1] + leg.length)
        return distances[::-1]

    def _is_passed(self, end: Point, place: Point, heading: float) -> bool:
        """Whether it is done with the end of its leg: near enough, or past it for good."""
        distance = math.dist(place, end)
        ahead, left = seen_from(place, heading, end)
        if ahead < 0 and distance <= self._out_of_reach:
            return True
        if self._to_stop[0] > 0:
            return distance <= self._passed_within
        # Where it stops, it goes on as near as it gets.
        is_nearest = distance <= self._pursuit.tolerance * _AT_THE_POINT or abs(self._off(ahead, left)) > _FAR_OFF
        return is_nearest and distance <= self._pursuit.tolerance

    def _on_the_spot(self, off: float) -> Twist:
        rate = braking_speed(abs(off), _BRAKES * self._mobility.turn_acceleration)
        return Twist.planar(0.0, math.copysign(min(self._pursuit.max_turn_rate, rate), off))

    def _along(self, ahead: float, left: float, to_stop: float) -> Twist:
        """Along the arc to a point; slower before a stop, and in curves that would turn the robot too fast."""
        tightest = _TIGHTEST * self._mobility.tightest
        curvature = curvature_to(ahead, left, self._before_axle)
        if abs(self._off(ahead, left)) > math.pi / 2 or abs(curvature) > tightest:
            curvature = math.copysign(tightest, left)
        speed = min(self._pursuit.speed, braking_speed(to_stop, _BRAKES * self._mobility.acceleration))
        speed = min(speed, self._pursuit.max_turn_rate / abs(curvature)) if curvature else speed
        return Twist.planar(speed, speed * curvature)
