"""Keys that several drives have."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from sim_action.core.field_types import PositiveMetres, PositiveNewtonMetres, Radians

WheelRadius = Annotated[PositiveMetres | None, Field(description="of a wheel; left out: read from the model")]

MotorTorque = Annotated[
    PositiveNewtonMetres | None, Field(description="limit of a wheel's motor; left out: the joint's own limit")
]

Heading = Annotated[
    Radians | None,
    Field(description="of forward, from the base's x axis to the left; left out: as the wheels in the model roll"),
]
