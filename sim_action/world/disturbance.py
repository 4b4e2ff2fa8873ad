"""What disturbs a robot or a body: a force, a torque or a push at a time."""

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

# In N and N m: a thousand times what the heaviest body weighs; more is a mistake that no engine's numbers hold.
_MAX_FORCE: Final = 1e10

Newtons = Annotated[float, Field(ge=-_MAX_FORCE, le=_MAX_FORCE), Quantity((units.FORCE,))]
NewtonMetres = Annotated[float, Field(ge=-_MAX_FORCE, le=_MAX_FORCE), Quantity((units.TORQUE,))]
PushMetresPerSecond = Annotated[MetresPerSecond, Field(ge=-MAX_SPEED, le=MAX_SPEED)]


class Disturbance(FrozenModel):
    """A force and a torque on a link or a body for some time, or a push that changes its velocity at once."""

    at: Annotated[NonNegativeSeconds, Field(description="sim time at which it begins")]
    duration: Annotated[
        PositiveSeconds | None,
        Field(alias="for", description="how long a force or a torque acts; a push takes no time"),
    ] = None
    link: Annotated[Name | None, Field(description="of the robot; left out, without a body: its base link")] = None
    body: Annotated[Name | None, Field(description="of the world, instead of a link")] = None
    force: Annotated[
        tuple[Newtons, Newtons, Newtons] | None,
        Field(description="x, y, z in the world frame, at the centre of mass if 'point' is left out"),
    ] = None
    point: Annotated[
        tuple[Coordinate, Coordinate, Coordinate] | None,
        Field(description="where the force acts, in the frame of the link or body"),
    ] = None
    torque: Annotated[
        tuple[NewtonMetres, NewtonMetres, NewtonMetres] | None, Field(description="x, y, z in the world frame")
    ] = None
    velocity: Annotated[
        tuple[PushMetresPerSecond, PushMetresPerSecond, PushMetresPerSecond] | None,
        Field(description="x, y, z in the world frame, added to that of a body or of the robot as a whole"),
    ] = None

    @property
    def end(self) -> float:
        """When it is over, in s of sim time."""
        return self.at + (self.duration or 0.0)

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        pushes, presses = self.velocity is not None, self.force is not None or self.torque is not None
        if self.link is not None and self.body is not None:
            raise ValueError("acts on a 'link' or on a 'body', not on both; make two of it")
        if pushes == presses:
            raise ValueError("a disturbance is a 'force' and a 'torque' for some time, or else a push of 'velocity'")
        if presses and self.duration is None:
            raise ValueError("say for how long it acts, such as for: 0.1 s")
        if pushes and self.duration is not None:
            raise ValueError("a push of 'velocity' takes no time; leave 'for' out")
        if self.point is not None and self.force is None:
            raise ValueError("'point' goes with a 'force'")
        return self
