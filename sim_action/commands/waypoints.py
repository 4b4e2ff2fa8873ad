"""Waypoints for a wheeled robot: `waypoints: [{x: 1, y: 0}, {x: 1, y: 1}]`."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, ClassVar, Final

from pydantic import Field

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

# In m: where floats no longer tell millimetres apart once they are squared.
_FURTHEST: Final = 1e6


class Waypoint(FrozenModel):
    """A point that the base link's origin passes."""

    x: Annotated[Metres, Field(ge=-_FURTHEST, le=_FURTHEST, description="in the world frame")]
    y: Annotated[Metres, Field(ge=-_FURTHEST, le=_FURTHEST, description="in the world frame")]


class WaypointCommands(CommandSource):
    """Drives the base through waypoints, one after the other, in straight lines by pure pursuit; then it stops.

    The path begins where the robot stands at t = 0. The source sees where the robot really is: what drives
    get wrong does not add up. It steers for the point of the path that is `lookahead` away; less keeps closer to the
    path, more steers more calmly. It never drives backward.

    A robot that can turn on the spot passes each waypoint within `tolerance`. It stops and turns where the path
    turns by more than 45 deg, and wherever it faces that far off its way.

    A car (`ackermann`) cuts corners instead: it passes each waypoint within `lookahead`, or within its smallest turning
    radius if that is more. If steering takes it past the last waypoint, it stops beside it.

    It slows down before it has to stop, at half the acceleration of the drive, and where a curve would take more than
    `max_turn_rate`.
    """

    needs_drive: ClassVar[bool] = True

    waypoints: Annotated[tuple[Waypoint, ...], Field(min_length=1, description="in the order in which they are passed")]
    speed: Annotated[PositiveMetresPerSecond, Field(description="on straight lines")] = 0.2
    lookahead: Annotated[PositiveMetres, Field(description="how far away the point is that it steers for")] = 0.3
    tolerance: Annotated[
        PositiveMetres, Field(description="from the last waypoint, at rest; from each, if it can turn on the spot")
    ] = 0.05
    max_turn_rate: Annotated[PositiveRadiansPerSecond, Field(description="in curves and on the spot")] = math.radians(
        60
    )
    rate: Annotated[PositiveHertz, Field(description="of the ticks at which a command is given")] = 20.0

    def problems(self, workspace: Workspace) -> SpecProblems:
        """Waypoints on which it would stand still, and figures with which it would miss them."""
        for index, (before, waypoint) in enumerate(pairwise(self.waypoints), start=1):
            if waypoint == before:
                yield ("waypoints", index), "the same point as the one before; leave one of them out"
        if self.lookahead < self.tolerance:
            yield ("lookahead",), f"must not be less than tolerance ({units.display(self.tolerance, 'm')})"
        if self.speed > self.tolerance * self.rate:
            step, least = units.display(self.speed / self.rate, "m"), self.speed / self.tolerance
            faster = f"a rate of {math.ceil(least)} Hz or more, or " if least <= MAX_PHYSICS_RATE_HZ else ""
            yield (
                ("speed",),
                (
                    f"from one tick to the next it would drive {step}, further than its tolerance of "
                    f"{units.display(self.tolerance, 'm')}; give {faster}a wider tolerance"
                ),
            )

    def open(self, scene: Scene) -> Controller:
        """See CommandSource.open."""
        pursuit = Pursuit(self.speed, self.lookahead, self.tolerance, self.max_turn_rate)
        points = [(waypoint.x, waypoint.y) for waypoint in self.waypoints]
        return ClosedLoop(PathFollower(points, pursuit, scene.mobility).command, senses=False)
