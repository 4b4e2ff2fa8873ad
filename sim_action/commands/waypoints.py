"""Drive a wheeled robot through waypoints: `waypoints: [{x: 1, y: 0}, {x: 1, y: 1}]`.

Pure pursuit steers along an arc to a point of the path ahead of the robot (R. C. Coulter, Implementation of the Pure
Pursuit Path Tracking Algorithm, CMU-RI-TR-92-01, 1992). Points are (x, y) in m; curvatures, in 1/m, are positive to the
left.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, ClassVar, Final

from pydantic import Field
from typing_extensions import override

from sim_action.commands import ClosedLoop, CommandSource, Controller
from sim_action.core import units
from sim_action.core.field_types import (
    FrozenModel,
    Metres,
    PositiveHertz,
    PositiveMetres,
    PositiveMetresPerSecond,
    PositiveRadiansPerSecond,
)
from sim_action.core.geometry import Twist
from sim_action.core.records import dataclass
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import SpecProblems
from sim_action.robot.model.kinematics import Mobility
from sim_action.state.observation import Observation
from sim_action.state.timeline import TimeMark, waypoint_mark
from sim_action.world import MAX_PHYSICS_RATE_HZ
from sim_action.world.claims import ClaimFinding, Findings, Setting
from sim_action.world.scene import Scene

_MAX_COORDINATE_M: Final = 1e6  # beyond this, squared coordinates no longer resolve millimetres


class Waypoint(FrozenModel):
    """A point for the base link's origin."""

    x: Annotated[Metres, Field(ge=-_MAX_COORDINATE_M, le=_MAX_COORDINATE_M, description="in the world frame")]
    y: Annotated[Metres, Field(ge=-_MAX_COORDINATE_M, le=_MAX_COORDINATE_M, description="in the world frame")]


class WaypointCommands(CommandSource):
    """Drives the base through waypoints in order, along straight lines by pure pursuit, and then stops.

    The path starts where the robot is at t = 0. The source knows the true pose, so errors of the drive do not add up.
    It steers to the point of the path that is `lookahead` away: a smaller value follows the path more closely. It never
    drives backward. It slows down before a stop, and in curves that would need more than `max_turn_rate`.

    A robot that can turn in place passes each waypoint within `tolerance`, and turns in place at angles above 45 deg. A
    car (`ackermann`) passes each waypoint within `lookahead`, or within its smallest turning radius if that is larger.
    If it drives past the last waypoint, it stops next to it.
    """

    key: ClassVar[str] = "waypoints"
    needs_drive: ClassVar[bool] = True
    is_written: ClassVar[bool] = True

    waypoints: Annotated[
        tuple[Waypoint, ...], Field(min_length=1, description="points in the order in which they are passed")
    ]
    speed: Annotated[PositiveMetresPerSecond, Field(description="speed on straight lines")] = 0.2
    lookahead: Annotated[PositiveMetres, Field(description="distance to the point of the path that it steers to")] = 0.3
    tolerance: Annotated[
        PositiveMetres,
        Field(description="largest distance from the last waypoint at rest; from each one if it can turn in place"),
    ] = 0.05
    max_turn_rate: Annotated[
        PositiveRadiansPerSecond, Field(description="largest turning rate, in curves and in place")
    ] = math.radians(60)
    rate: Annotated[PositiveHertz, Field(description="of the ticks at which a command is given")] = 20.0

    def problems(self, workspace: Workspace) -> SpecProblems:
        """Yield repeated waypoints, and values with which the robot would miss waypoints."""
        for index, (before, waypoint) in enumerate(pairwise(self.waypoints), start=1):
            if waypoint == before:
                yield ("waypoints", index), "this is the same point as the one before; remove one of them"
        if self.lookahead < self.tolerance:
            yield ("lookahead",), f"must not be less than tolerance ({units.display(self.tolerance, 'm')})"
        if self.speed > self.tolerance * self.rate:
            step, least = units.display(self.speed / self.rate, "m"), self.speed / self.tolerance
            faster = f"a rate of {math.ceil(least)} Hz or more, or " if least <= MAX_PHYSICS_RATE_HZ else ""
            yield (
                ("speed",),
                (
                    f"between two ticks the robot would drive {step}, which is more than the tolerance of "
                    f"{units.display(self.tolerance, 'm')}; set {faster}a larger tolerance"
                ),
            )

    @property
    @override
    def stated_path(self) -> tuple[Point, ...]:
        return tuple((point.x, point.y) for point in self.waypoints)

    @override
    def robot_claims(self, scene: Scene, setting: Setting) -> Findings:
        place = (scene.placement.x, scene.placement.y)
        if all(math.dist(place, (point.x, point.y)) <= self.tolerance for point in self.waypoints):
            message = "the robot stands at all waypoints when it starts, so it does not drive; move them"
            yield ClaimFinding("no-effect", ("waypoints",), message)

    @override
    def open(self, scene: Scene) -> Controller:
        follower = PathFollower(self, scene.mobility)
        return ClosedLoop(follower.command, senses=False, begin=follower.begin, marks=follower.marks)


Point = tuple[float, float]
_ROUNDING: Final = 1e-9  # points that are closer than this are equal

# Beyond the first heading error, a robot turns in place if it can, until the error is below the second. In rad.
_FAR_OFF: Final = math.radians(45)
_ALIGNED: Final = math.radians(3)
_AT_THE_POINT: Final = 0.25  # within this share of the tolerance, the robot has arrived

# Shares of the drive's limits that are used; the rest is a reserve for corrections.
_BRAKES: Final = 0.5
_TIGHTEST: Final = 0.99


@dataclass(frozen=True, slots=True)
class Leg:
    """A straight segment of the path, in the world frame."""

    start: Point
    end: Point

    @property
    def length(self) -> float:
        """The length in m."""
        return math.dist(self.start, self.end)

    @property
    def direction(self) -> float:
        """The direction in rad from the world's x axis."""
        return math.atan2(self.end[1] - self.start[1], self.end[0] - self.start[0])

    def closest(self, point: Point) -> Point:
        """Return the point of the leg that is closest to another point."""
        along, _ = self._foot(point)
        return self._at(along)

    def lookahead_point(self, point: Point, lookahead: float) -> Point:
        """Return the first point after the closest one that is `lookahead` m away; the end if there is none."""
        along, beside = self._foot(point)
        return self._at(along + math.sqrt(max(0.0, lookahead**2 - beside**2)))

    def _foot(self, point: Point) -> Point:
        return in_robot_frame(self.start, self.direction, point)

    def _at(self, along: float) -> Point:
        if along <= 0 or along >= self.length:
            return self.start if along <= 0 else self.end
        share = along / self.length
        (x, y), (end_x, end_y) = self.start, self.end
        return (x + share * (end_x - x), y + share * (end_y - y))


def in_robot_frame(place: Point, heading: float, point: Point) -> Point:
    """Return the position of a point ahead and to the left of a robot, in m. `heading`: rad from the world's x axis."""
    x, y = point[0] - place[0], point[1] - place[1]
    cosine, sine = math.cos(heading), math.sin(heading)
    return (cosine * x + sine * y, cosine * y - sine * x)


def curvature_to(ahead: float, left: float, before_axle: float = 0.0) -> float:
    """Return the curvature of the arc from the robot to a point.

    :param before_axle: m, distance of the reference point of the robot in front of its axle. The centre of the arc lies
        on the line of the axle. With 0, the result is Coulter's: 2 left / distance^2.
    """
    chord = ahead**2 + left**2 + 2 * before_axle * ahead
    return 2 * left / chord if chord > _ROUNDING**2 else 0.0


def turn_angles(legs: Sequence[Leg]) -> list[float]:
    """Return the angle by which the path turns after each leg but the last, in rad, without sign."""
    return [abs(math.remainder(after.direction - leg.direction, math.tau)) for leg, after in pairwise(legs)]


def braking_speed(distance: float, deceleration: float) -> float:
    """Return the speed, or turning rate, from which a constant deceleration stops after a distance, or angle."""
    return math.sqrt(2 * deceleration * distance)


class PathFollower:
    """Follows a path leg by leg; the next leg begins when a waypoint is passed.

    `marks`: the waypoints that it has passed.
    """

    def __init__(self, pursuit: WaypointCommands, mobility: Mobility) -> None:
        self.marks: list[TimeMark] = []
        self._pursuit = pursuit
        self._mobility = mobility
        cuts_corners = not mobility.turns_in_place
        self._passed_within = max(pursuit.lookahead, mobility.turning_radius) if cuts_corners else pursuit.tolerance
        # Within this distance, a waypoint that is no longer ahead cannot be reached, not even after turning.
        self._out_of_reach = max(mobility.turning_radius, 2 * abs(mobility.ahead))
        self._legs: list[Leg] | None = None
        self._to_stop: list[float] = []
        self._turning = False

    def begin(self) -> None:
        """Follow the whole path from where the robot will be at the next tick."""
        self._legs, self._turning = None, False

    def command(self, seen: Observation) -> Twist:
        """Return the twist at a tick. It must be called at every tick, because it keeps its progress."""
        place, heading = seen.pose.position_xyz[:2], seen.pose.yaw + self._mobility.heading
        if self._legs is None:
            points = ((waypoint.x, waypoint.y) for waypoint in self._pursuit.waypoints)
            self._legs = [Leg(*ends) for ends in pairwise((place, *points))]
            # The distance from the end of each leg to the next stop: at the end, or to turn in place.
            distances = [0.0]
            for leg, turn in zip(reversed(self._legs[1:]), reversed(turn_angles(self._legs)), strict=True):
                stops = self._mobility.turns_in_place and turn > _FAR_OFF
                distances.append(0.0 if stops else distances[-1] + leg.length)
            self._to_stop = distances[::-1]
        while self._legs and self._is_passed(self._legs[0].end, place, heading):
            del self._legs[0], self._to_stop[0]
            count = len(self._pursuit.waypoints)
            self.marks.append(waypoint_mark(seen.time, count - len(self._legs), count))
        if not self._legs:
            return Twist()
        ahead, left = in_robot_frame(place, heading, self._legs[0].lookahead_point(place, self._pursuit.lookahead))
        off = self._off(ahead, left)
        self._turning = self._mobility.turns_in_place and abs(off) > (_ALIGNED if self._turning else _FAR_OFF)
        if self._turning:
            rate = braking_speed(abs(off), _BRAKES * self._mobility.turn_acceleration)
            return Twist.planar(0.0, math.copysign(min(self._pursuit.max_turn_rate, rate), off))
        return self._along(ahead, left, math.dist(place, self._legs[0].end) + self._to_stop[0])

    @property
    def _before_axle(self) -> float:
        # An origin behind the axle is treated as on the axle: no arc leads it to a point at its side.
        return max(0.0, self._mobility.ahead)

    def _off(self, ahead: float, left: float) -> float:
        return math.atan2(left, ahead + self._before_axle)

    def _is_passed(self, end: Point, place: Point, heading: float) -> bool:
        """Return True if the end of the current leg is passed: the robot is near enough, or can no longer reach it."""
        distance = math.dist(place, end)
        ahead, left = in_robot_frame(place, heading, end)
        if ahead < 0 and distance <= self._out_of_reach:
            return True
        if self._to_stop[0] > 0:
            return distance <= self._passed_within
        # At a stop, the robot approaches as closely as it can.
        is_nearest = distance <= self._pursuit.tolerance * _AT_THE_POINT or abs(self._off(ahead, left)) > _FAR_OFF
        return is_nearest and distance <= self._pursuit.tolerance

    def _along(self, ahead: float, left: float, to_stop: float) -> Twist:
        """Return the twist along the arc to a point; slower before a stop and in tight curves."""
        tightest = _TIGHTEST * self._mobility.tightest
        curvature = curvature_to(ahead, left, self._before_axle)
        if abs(self._off(ahead, left)) > math.pi / 2 or abs(curvature) > tightest:
            curvature = math.copysign(tightest, left)
        speed = min(self._pursuit.speed, braking_speed(to_stop, _BRAKES * self._mobility.acceleration))
        speed = min(speed, self._pursuit.max_turn_rate / abs(curvature)) if curvature else speed
        return Twist.planar(speed, speed * curvature)
