"""How the engine steps, and what counts as unstable."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import BeforeValidator, Field

from sim_action.core import units
from sim_action.core.field_types import (
    FrozenModel,
    MetresPerSecond,
    MetresPerSecondSquared,
    NonNegativeSeconds,
    PositiveHertz,
    PositiveMetres,
    RadiansPerSecond,
)
from sim_action.core.geometry import Vector3

MAX_PHYSICS_RATE_HZ: Final = 100_000.0
"""Hz, of physics steps and thereby of all ticks."""

MAX_SPEED: Final = 10_000.0
"""m/s and rad/s at which engines are told to stop the base and every joint: bounds of speed go no further."""


class Physics(FrozenModel):
    """How the engine steps."""

    rate: Annotated[PositiveHertz, Field(ge=1, le=MAX_PHYSICS_RATE_HZ, description="steps in a second of sim time")] = (
        240.0
    )
    settle: Annotated[
        NonNegativeSeconds, Field(le=60, description="longest time to come to rest before t = 0; 0: do not wait")
    ] = 2.0
    max_speed: Annotated[
        MetresPerSecond,
        Field(gt=0, le=MAX_SPEED, description="of the base and of joints that slide; from there on, it is unstable"),
    ] = 100.0
    max_turn_rate: Annotated[
        RadiansPerSecond,
        Field(gt=0, le=MAX_SPEED, description="of the base and of joints that turn; from there on, it is unstable"),
    ] = 1000.0
    max_distance: Annotated[
        PositiveMetres, Field(description="of the base from where it began; from there on, it is unstable")
    ] = 10_000.0
    max_depth: Annotated[
        PositiveMetres | None,
        Field(description="of the base below the ground; left out: as far as its shapes are from it, and 1 m"),
    ] = None


GRAVITY: Final = 9.80665
"""m/s^2, standard gravity (CGPM 1901)."""

MAX_GRAVITY: Final = 1000.0
"""m/s^2: forty times that of Jupiter."""


def _vector(value: object) -> Vector3:
    """Of one number, which is downwards, or of three."""
    if not isinstance(value, (list, tuple)):
        down = _acceleration(value)
        if down < 0:
            raise ValueError(f"one number is downwards, so it is 0 or more; upwards is [0, 0, {-down:g}]")
        return (0.0, 0.0, -down)
    if len(value) != 3:
        raise ValueError(f"expected one number or a list of three, x, y and z; found {len(value)}")
    x, y, z = map(_acceleration, value)
    return (x, y, z)


def _acceleration(value: object) -> float:
    try:
        found = units.parse(value, units.ACCELERATION)
    except units.UnitError as error:
        raise ValueError(str(error)) from None
    if abs(found) > MAX_GRAVITY:
        raise ValueError(f"must be at most {MAX_GRAVITY:g} m/s^2, found {found:g}")
    return found


Gravity = Annotated[
    MetresPerSecondSquared | tuple[MetresPerSecondSquared, MetresPerSecondSquared, MetresPerSecondSquared],
    BeforeValidator(_vector),
    Field(description="downwards, or as [x, y, z]; 0 is allowed", validate_default=True),
]
