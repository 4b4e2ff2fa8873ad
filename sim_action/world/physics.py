"""How the engine steps, and what counts as unstable."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import Field

from sim_action.core.field_types import (
    FrozenModel,
    MetresPerSecond,
    NonNegativeSeconds,
    PositiveHertz,
    PositiveMetres,
    RadiansPerSecond,
)

FASTEST_PHYSICS: Final = 100_000.0
"""Hz, of physics steps and thereby of all ticks."""

FASTEST: Final = 10_000.0
"""m/s and rad/s at which engines are told to stop the base and every joint: bounds of speed go no further."""


class Physics(FrozenModel):
    """How the engine steps."""

    rate: Annotated[PositiveHertz, Field(ge=1, le=FASTEST_PHYSICS, description="steps in a second of sim time")] = 240.0
    settle: Annotated[
        NonNegativeSeconds, Field(le=60, description="longest time to come to rest before t = 0; 0: do not wait")
    ] = 2.0
    max_speed: Annotated[
        MetresPerSecond,
        Field(gt=0, le=FASTEST, description="of the base and of joints that slide; from there on, it is unstable"),
    ] = 100.0
    max_turn_rate: Annotated[
        RadiansPerSecond,
        Field(gt=0, le=FASTEST, description="of the base and of joints that turn; from there on, it is unstable"),
    ] = 1000.0
    max_distance: Annotated[
        PositiveMetres, Field(description="of the base from where it began; from there on, it is unstable")
    ] = 10_000.0
    max_depth: Annotated[
        PositiveMetres | None,
        Field(description="of the base below the ground; left out: as far as its shapes are from it, and 1 m"),
    ] = None
