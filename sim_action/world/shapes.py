"""The shapes that a body may have and that are said in a few numbers."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Final, Self

from pydantic import Field, model_validator

from sim_action.core.field_types import FrozenModel, Metres, PositiveRadians
from sim_action.core.geometry import Pose

if TYPE_CHECKING:
    from sim_action.world.parts import BoxPart, HullPart

SMALLEST: Final = 1e-4
"""m: what is smaller than a hair is wide, no engine can tell from nothing."""

LARGEST: Final = 10_000.0
"""m: beyond, the engines' numbers know no millimetres."""

Size = Annotated[Metres, Field(ge=SMALLEST, le=LARGEST)]
"""A length of a body in m."""

MAX_STEPS: Final = 500
"""Of one flight of stairs: more than up the highest tower in the world between two landings."""

_STEEPEST: Final = math.radians(85)


class Cylinder(FrozenModel):
    """An upright cylinder."""

    radius: Size
    height: Size


class Sphere(FrozenModel):
    """A ball."""

    radius: Size


class Ramp(FrozenModel):
    """A wedge that rises along its own x axis, from nothing to its height, over its length on the ground.

    Its `pose` is that of the middle of the box around it: one of 1 m at `x: 2` begins at 1.5 m. It is fixed. What
    drives up needs a friction of more than the tangent of its angle; frictions multiply, and a body has 0.5 if it does
    not say.
    """

    length: Size
    width: Size
    height: Annotated[Size | None, Field(description="where it ends; or give its 'angle'")] = None
    angle: Annotated[PositiveRadians | None, Field(le=_STEEPEST, description="of its slope; or give its 'height'")] = (
        None
    )

    @model_validator(mode="after")
    def _rises(self) -> Self:
        if (self.height is None) == (self.angle is None):
            raise ValueError("a ramp has either a 'height' or an 'angle'")
        return self

    @property
    def rise(self) -> float:
        """Its height in m."""
        return self.length * math.tan(self.angle) if self.height is None and self.angle else self.height or 0.0

    def parts(self) -> tuple[HullPart]:
        """About the middle of the box around it."""
        from sim_action.world.parts import HullPart

        x, y, z = self.length / 2, self.width / 2, self.rise / 2
        corners = ((-x, -z), (x, -z), (x, z))
        return (HullPart(tuple((ahead, side, up) for side in (-y, y) for ahead, up in corners)),)


class Stairs(FrozenModel):
    """Steps that rise along their own x axis, each as high as `rise` and as deep as `run`.

    Its `pose` is that of the middle of the box around all of them. It is fixed.
    """

    steps: Annotated[int, Field(ge=1, le=MAX_STEPS)]
    rise: Annotated[Size, Field(description="height of a step")]
    run: Annotated[Size, Field(description="depth of a step")]
    width: Size

    def parts(self) -> tuple[BoxPart, ...]:
        """A column a step, about the middle of the box around all of them."""
        from sim_action.world.parts import BoxPart

        length, height = self.steps * self.run, self.steps * self.rise
        return tuple(
            BoxPart(
                (self.run, self.width, (step + 1) * self.rise),
                Pose(((step + 0.5) * self.run - length / 2, 0.0, ((step + 1) * self.rise - height) / 2)),
            )
            for step in range(self.steps)
        )
