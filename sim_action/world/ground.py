"""What everything stands on."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from sim_action.quantities import FrozenModel, NonNegativeRatio

GROUND = "ground"


class Ground(FrozenModel):
    """The plane z = 0."""

    friction: Annotated[NonNegativeRatio, Field(description="multiplies with the friction of what touches it")] = 1.0
