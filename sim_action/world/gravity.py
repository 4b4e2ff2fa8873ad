"""What pulls everything down."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import BeforeValidator, Field

from sim_action.core import units
from sim_action.core.field_types import MetresPerSecondSquared
from sim_action.core.geometry import Vector3

GRAVITY: Final = 9.80665
"""m/s^2, standard gravity (CGPM 1901)."""

STRONGEST: Final = 1000.0
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
    if abs(found) > STRONGEST:
        raise ValueError(f"must be at most {STRONGEST:g} m/s^2, found {found:g}")
    return found


Gravity = Annotated[
    MetresPerSecondSquared | tuple[MetresPerSecondSquared, MetresPerSecondSquared, MetresPerSecondSquared],
    BeforeValidator(_vector),
    Field(description="downwards, or as [x, y, z]; 0 is allowed", validate_default=True),
]
