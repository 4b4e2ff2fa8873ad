"""Shapes that are read from files, and grounds of many heights."""

from __future__ import annotations

from typing import Annotated, Final, Self

from pydantic import Field, model_validator

from sim_action.core.field_types import FrozenModel, Metres, NamesFile, PositiveRatio
from sim_action.world.shapes import LARGEST, Size

Factor = Annotated[PositiveRatio, Field(le=1e6)]
Height = Annotated[Metres, Field(ge=-LARGEST, le=LARGEST)]
_LEAST_SAMPLES: Final = 2

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
        if self.heights is not None and min([len(lengths), *lengths]) < _LEAST_SAMPLES:
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
