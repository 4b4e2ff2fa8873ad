"""Disturbances of a robot or a body: a force, a torque or a push at a given time."""

from __future__ import annotations

from typing import Annotated, Final, Self

from pydantic import Field, model_validator

from sim_action.core import units
from sim_action.core.field_types import (
    Coordinate,
    FrozenModel,
    MetresPerSecond,
    Name,
    NonNegativeSeconds,
    PositiveSeconds,
    Quantity,
)
from sim_action.world.physics import MAX_SPEED

MAX_FORCE: Final = 1e10
"""N and N m: a thousand times the weight of the heaviest body; more is a mistake and overflows in the engines."""

Newtons = Annotated[float, Field(ge=-MAX_FORCE, le=MAX_FORCE), Quantity((units.FORCE,))]
NewtonMetres = Annotated[float, Field(ge=-MAX_FORCE, le=MAX_FORCE), Quantity((units.TORQUE,))]
PushMetresPerSecond = Annotated[MetresPerSecond, Field(ge=-MAX_SPEED, le=MAX_SPEED)]


class Disturbance(FrozenModel):
    """A force and a torque on a link or a body for some time, or a push that changes its velocity at once."""

    at: Annotated[NonNegativeSeconds, Field(description="sim time at which it starts")]
    duration: Annotated[
        PositiveSeconds | None,
        Field(alias="for", description="duration of a force or a torque; a push has none"),
    ] = None
    link: Annotated[Name | None, Field(description="link of the robot; default without 'body': its base link")] = None
    body: Annotated[Name | None, Field(description="body of the world, instead of a link")] = None
    force: Annotated[
        tuple[Newtons, Newtons, Newtons] | None,
        Field(description="x, y, z in the world frame; acts at the centre of mass without 'point'"),
    ] = None
    point: Annotated[
        tuple[Coordinate, Coordinate, Coordinate] | None,
        Field(description="point at which the force acts, in the frame of the link or body"),
    ] = None
    torque: Annotated[
        tuple[NewtonMetres, NewtonMetres, NewtonMetres] | None, Field(description="x, y, z in the world frame")
    ] = None
    velocity: Annotated[
        tuple[PushMetresPerSecond, PushMetresPerSecond, PushMetresPerSecond] | None,
        Field(description="x, y, z in the world frame; added to the velocity of a body or of the whole robot"),
    ] = None

    @property
    def end(self) -> float:
        """The end in s of sim time."""
        return self.at + (self.duration or 0.0)

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        pushes, presses = self.velocity is not None, self.force is not None or self.torque is not None
        if self.link is not None and self.body is not None:
            raise ValueError("give 'link' or 'body', not both; use two disturbances")
        if pushes == presses:
            raise ValueError("a disturbance needs either 'force' and 'torque' (one or both), or 'velocity'")
        if presses and self.duration is None:
            raise ValueError("a force or a torque needs a duration, such as for: 0.1 s")
        if pushes and self.duration is not None:
            raise ValueError("a push of 'velocity' has no duration; remove 'for'")
        if self.point is not None and self.force is None:
            raise ValueError("'point' needs a 'force'")
        return self
