"""What everything stands on."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import Field

from sim_action.core.field_types import FrozenModel, Metres, NonNegativeRatio

GROUND: Final = "ground"

Friction = Annotated[NonNegativeRatio, Field(le=100)]

Side = Annotated[Metres, Field(ge=0.01, le=1000)]


class Ground(FrozenModel):
    """The plane z = 0."""

    friction: Annotated[Friction, Field(description="multiplies with the friction of what touches it")] = 1.0


class Patch(FrozenModel):
    """An area of the ground with a friction of its own.

    It is level with the ground, which is cut around it: there is no step, and no place where both hold. To contacts it
    is the ground. Patches may touch and must not lie on each other; at most 50. The ground then ends at 10 km.
    """

    x: Annotated[Metres, Field(ge=-1000, le=1000, description="of its middle")] = 0.0
    y: Annotated[Metres, Field(ge=-1000, le=1000, description="of its middle")] = 0.0
    size: Annotated[tuple[Side, Side], Field(description="x and y")]
    friction: Annotated[Friction, Field(description="as of the ground, in its place")]

    @property
    def bounds(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """From where to where in x, and in y, in m."""
        (width, depth) = self.size
        return (self.x - width / 2, self.x + width / 2), (self.y - depth / 2, self.y + depth / 2)
