"""The shapes that a body may have and that are said in a few numbers."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Final, Self

from pydantic import Field, model_validator

from sim_action.core.field_types import FrozenModel, Metres, NamesFile, PositiveRadians, PositiveRatio
from sim_action.core.geometry import Pose

if TYPE_CHECKING:
    from sim_action.world.parts import BoxPart, HullPart


MIN_LENGTH_M: Final = 1e-4
"""m: what is smaller than a hair is wide, no engine can tell from nothing."""

MAX_LENGTH_M: Final = 10_000.0
"""m: beyond, the engines' numbers know no millimetres."""

Size = Annotated[Metres, Field(ge=MIN_LENGTH_M, le=MAX_LENGTH_M)]
"""A length of a body in m."""

MAX_STEPS: Final = 500
"""Of one flight of stairs: more than up the highest tower in the world between two landings."""

_MAX_SLOPE_RAD: Final = math.radians(85)


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
    angle: Annotated[
        PositiveRadians | None, Field(le=_MAX_SLOPE_RAD, description="of its slope; or give its 'height'")
    ] = None

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


Factor = Annotated[PositiveRatio, Field(le=1e6)]
Height = Annotated[Metres, Field(ge=-MAX_LENGTH_M, le=MAX_LENGTH_M)]
_MIN_SAMPLES: Final = 2

File = Annotated[str, NamesFile(), Field(min_length=1)]


class MeshFile(FrozenModel):
    """Triangles of a file: as they are if the body is fixed, and their convex hull if it has a mass.

    Its `pose` is that of the file's own origin; z left out, its lowest point is on the ground. What is hollow or open
    stays so. At most 40,000 triangles, if they are not convex. MuJoCo knows convex pieces alone, and gets a thin one
    behind each triangle, 5 mm at the most, so at most 4,000 there; which side is behind, the order of the corners says.
    With a mass, the hull is filled evenly.
    """

    file: Annotated[File, Field(description="a .stl, .obj or .dae, seen from the scenario")]
    scale: Annotated[Factor, Field(description="m in a unit of the file")] = 1.0


class Heightfield(FrozenModel):
    """Ground of many heights: samples on a grid, seen from above as on a map, with straight lines between them.

    Rows go from the highest y to the lowest, as those of an image do. Between four samples are two triangles, with the
    fold from the lowest x and y to the highest. Its `pose` is that of the middle, at height 0. With `z: 0`, heights are
    those of the world, and what is below 0 is under the ground; z left out, all of it is raised or lowered until its
    lowest sample is on the ground: of heights from -1 m to 2 m, the highest is then at 3 m. A robot that begins on it
    needs a z of its own. At most 250,000 samples (500 x 500); it is fixed.
    """

    heights: Annotated[
        tuple[tuple[Height, ...], ...] | None,
        Field(description="rows from the highest y to the lowest, each from the lowest x to the highest"),
    ] = None
    image: Annotated[
        File | None, Field(description="a .pgm or a grey .png instead, of 8 or 16 bits: black is low, white is high")
    ] = None
    size: Annotated[tuple[Size, Size], Field(description="x and y, from the first sample to the last")]
    height: Annotated[Size | None, Field(description="of white above black; with an image alone")] = None

    @model_validator(mode="after")
    def _has_heights(self) -> Self:
        if (self.heights is None) == (self.image is None):
            raise ValueError("a heightfield has either 'heights' or an 'image'")
        if (self.image is None) != (self.height is None):
            raise ValueError("'height' says how high the white of an 'image' is; 'heights' are in m already")
        lengths = [len(row) for row in self.heights or ()]
        if self.heights is not None and min([len(lengths), *lengths]) < _MIN_SAMPLES:
            raise ValueError("'heights' has at least two rows, and each of them at least two samples")
        odd = next((row for row, length in enumerate(lengths) if length != lengths[0]), None)
        if odd is not None:
            raise ValueError(f"'heights' is ragged: row 0 has {lengths[0]} samples, row {odd} has {lengths[odd]}")
        return self


class OccupancyMap(FrozenModel):
    """Walls where a map of ROS's map_server says that a cell is occupied. What is free or unknown is empty.

    Of the YAML file count `image` (a PGM, or a grey PNG, beside it), `resolution`, `origin` with its yaw, `negate`,
    `occupied_thresh` and `free_thresh`; the `mode` is `trinary`. The map's frame is the world's, moved by the body's
    `pose`. Cells that stand in line become one box: an office of 1,000 x 1,000 cells comes to a few hundred. At most
    16 million cells and 2,000 boxes; it is fixed.
    """

    file: Annotated[File, Field(description="the map's .yaml, seen from the scenario; its image is a .pgm or .png")]
    height: Annotated[Size, Field(description="of the walls")] = 1.0
