"""Twists over time: `twist: [{linear: 1.0, for: 2 s}, {linear: 0.2}]`."""

from __future__ import annotations

from itertools import accumulate
from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator

from sim_action.command import Command
from sim_action.commands import CommandSource, Controller, OpenLoop
from sim_action.geometry import Twist
from sim_action.quantities import FrozenModel, MetresPerSecond, PositiveSeconds, RadiansPerSecond
from sim_action.scene import Scene


class TwistSegment(FrozenModel):
    """One twist for some time."""

    linear: Annotated[MetresPerSecond, Field(description="forward speed of the base")] = 0.0
    lateral: Annotated[MetresPerSecond, Field(description="speed to the left; only mecanum wheels can")] = 0.0
    angular: Annotated[RadiansPerSecond, Field(description="turning rate, to the left")] = 0.0
    duration: Annotated[
        PositiveSeconds | None, Field(alias="for", description="left out, in the last segment: until the end")
    ] = None

    @property
    def twist(self) -> Twist:
        """The command of this segment."""
        return Twist.planar(self.linear, self.angular, lateral=self.lateral)


class TwistCommands(CommandSource):
    """Drives the base by twists, one after the other; after the last that has an end, it stops."""

    needs_drive: ClassVar[bool] = True

    twist: Annotated[tuple[TwistSegment, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _only_the_last_is_open(self) -> Self:
        if any(segment.duration is None for segment in self.twist[:-1]):
            raise ValueError("only the last segment may leave out 'for'")
        return self

    def open(self, scene: Scene) -> Controller:
        """See CommandSource.open."""
        ends = tuple(accumulate(float("inf") if s.duration is None else s.duration for s in self.twist))
        twists = tuple(segment.twist for segment in self.twist)

        def command(time: float) -> Command:
            # A tick that falls on a segment's end belongs to the next one, whatever the rounding of either.
            now = time + _ROUNDING
            return next((twist for end, twist in zip(ends, twists, strict=True) if now < end), Twist())

        return OpenLoop(command)


_ROUNDING = 1e-9
