"""Drive a wheeled robot through waypoints: `waypoints: [{x: 1, y: 0}, {x: 1, y: 1}]`."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, ClassVar, Final

from pydantic import Field
from typing_extensions import override

from sim_action.commands import ClosedLoop, CommandSource, Controller
from sim_action.commands.pure_pursuit import PathFollower, Pursuit
from sim_action.core import units
from sim_action.core.field_types import (
    FrozenModel,
    Metres,
    PositiveHertz,
    PositiveMetres,
    PositiveMetresPerSecond,
    PositiveRadiansPerSecond,
)
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_errors import SpecProblems
from sim_action.world import MAX_PHYSICS_RATE_HZ
from sim_action.world.scene import Scene

# Beyond this, squared coordinates no longer resolve millimetres.
_MAX_COORDINATE_M: Final = 1e6


class Waypoint(FrozenModel):
    """A point for the base link's origin."""

    x: Annotated[Metres, Field(ge=-_MAX_COORDINATE_M, le=_MAX_COORDINATE_M, description="in the world frame")]
    y: Annotated[Metres, Field(ge=-_MAX_COORDINATE_M, le=_MAX_COORDINATE_M, description="in the world frame")]


class WaypointCommands(CommandSource):
    """Drives the base through waypoints in order, along straight lines by pure pursuit, and then stops.

    The path starts at the position of the robot at t = 0. The source knows the true pose of the robot, so errors of
    the drive do not accumulate. It steers to the point of the path that is `lookahead` away: a smaller value follows
    the path more closely, a larger value steers more smoothly. It never drives backward.

    A robot that can turn in place passes each waypoint within `tolerance`. It stops and turns in place where the path
    turns by more than 45 deg, and where its heading is off by more than 45 deg.

    A car (`ackermann`) cuts corners: it passes each waypoint within `lookahead`, or within its smallest turning radius
    if that is larger. If it drives past the last waypoint, it stops next to it.

    It slows down before a stop, with half the acceleration of the drive, and in curves that would need more than
    `max_turn_rate`.
    """

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

    @override
    def open(self, scene: Scene) -> Controller:
        pursuit = Pursuit(self.speed, self.lookahead, self.tolerance, self.max_turn_rate)
        points = [(waypoint.x, waypoint.y) for waypoint in self.waypoints]
        return ClosedLoop(PathFollower(points, pursuit, scene.mobility).command, senses=False)
