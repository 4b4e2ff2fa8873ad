"""One object of the world, fixed or with a mass."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from sim_action.quantities import FrozenModel, Name, NonNegativeRatio, PositiveKilograms, PositiveMetres
from sim_action.world.placement import Placement
from sim_action.world.shapes import Cylinder, Sphere

Share = Annotated[float, Field(ge=0, le=1)]


class Body(FrozenModel):
    """A box, a cylinder or a sphere."""

    name: Name
    box: Annotated[tuple[PositiveMetres, PositiveMetres, PositiveMetres] | None, Field(description="full x, y, z")] = (
        None
    )
    cylinder: Annotated[Cylinder | None, Field(description="upright, about its own z axis")] = None
    sphere: Sphere | None = None
    pose: Annotated[Placement, Field(description="of the centre")] = Placement()
    mass: Annotated[PositiveKilograms | None, Field(description="left out: it is fixed")] = None
    friction: NonNegativeRatio = 0.5
    color: Annotated[
        tuple[Share, Share, Share] | None,
        Field(description="red, green, blue, each 0 to 1, for cameras; left out: one of a row that has no red in it"),
    ] = None

    @model_validator(mode="after")
    def _has_one_shape(self) -> Self:
        if sum(shape is not None for shape in (self.box, self.cylinder, self.sphere)) != 1:
            raise ValueError("an object has exactly one of 'box', 'cylinder' and 'sphere'")
        return self
