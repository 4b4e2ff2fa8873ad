"""The shapes of bodies as keys of a scenario: primitives, ramp, stairs, mesh, heightfield, map; and their files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Final, Self

from pydantic import BeforeValidator, Field, model_validator

from sim_action.core import units
from sim_action.core.field_types import FrozenModel, Metres, NamesFile, PositiveRadians, PositiveRatio
from sim_action.core.files import read_at_most
from sim_action.core.geometry import Pose
from sim_action.core.workspace import PathError, Workspace
from sim_action.world.parts import BoxPart, HullPart

MIN_LENGTH_M: Final = 1e-4  # the least length in m; engines cannot resolve less
MAX_LENGTH_M: Final = 10_000.0  # the greatest length in m; beyond, the engines' numbers do not resolve millimetres
Size = Annotated[Metres, Field(ge=MIN_LENGTH_M, le=MAX_LENGTH_M)]  # a length of a body in m
MAX_STEPS: Final = 500  # limit for one flight of stairs
_MAX_SLOPE_RAD: Final = math.radians(85)


class Cylinder(FrozenModel):
    """An upright cylinder."""

    radius: Size
    height: Size


class Sphere(FrozenModel):
    """A ball."""

    radius: Size


class Ramp(FrozenModel):
    """A wedge that rises along its own x axis, from 0 to its height over its length.

    Its `pose` places the centre of its bounding box: a ramp of 1 m at `x: 2` starts at 1.5 m. It is fixed. To drive
    up, the product of both frictions must exceed the tangent of the angle; the default friction of a body is 0.5.
    """

    length: Size
    width: Size
    height: Annotated[Size | None, Field(description="height at its end; alternative: 'angle'")] = None
    angle: Annotated[
        PositiveRadians | None, Field(le=_MAX_SLOPE_RAD, description="angle of its slope; alternative: 'height'")
    ] = None

    @model_validator(mode="after")
    def _rises(self) -> Self:
        if (self.height is None) == (self.angle is None):
            raise ValueError("a ramp needs either 'height' or 'angle'")
        return self

    @property
    def rise(self) -> float:
        """The height in m."""
        return self.length * math.tan(self.angle) if self.height is None and self.angle else self.height or 0.0

    def parts(self) -> tuple[HullPart]:
        """Return the parts, centred in the bounding box."""
        x, y, z = self.length / 2, self.width / 2, self.rise / 2
        corners = ((-x, -z), (x, -z), (x, z))
        return (HullPart(tuple((ahead, side, up) for side in (-y, y) for ahead, up in corners)),)


class Stairs(FrozenModel):
    """Steps that rise along their own x axis, each `rise` high and `run` deep.

    The `pose` places the centre of the bounding box of all steps. Stairs are fixed.
    """

    steps: Annotated[int, Field(ge=1, le=MAX_STEPS)]
    rise: Annotated[Size, Field(description="height of a step")]
    run: Annotated[Size, Field(description="depth of a step")]
    width: Size

    def parts(self) -> tuple[BoxPart, ...]:
        """Return one box per step, centred in the bounding box of all."""
        length, height = self.steps * self.run, self.steps * self.rise
        return tuple(
            BoxPart(
                (self.run, self.width, (step + 1) * self.rise),
                Pose(((step + 0.5) * self.run - length / 2, 0.0, ((step + 1) * self.rise - height) / 2)),
            )
            for step in range(self.steps)
        )


_MAX_FACTOR: Final = 1e6
Factor = Annotated[PositiveRatio, Field(le=_MAX_FACTOR)]


def _scale(value: object) -> object:
    """Return one factor, or three. Raises ValueError."""
    if not isinstance(value, (list, tuple)):
        return _factor(value)
    if len(value) != 3:
        raise ValueError(f"expected one number, or a list of three (x, y, z); found a list of {len(value)}")
    return tuple(map(_factor, value))


def _factor(value: object) -> float:
    try:
        factor = units.parse(value, units.RATIO)
    except units.UnitError as error:
        raise ValueError(str(error)) from None
    if factor <= 0:
        raise ValueError(f"must be greater than 0, found {value}")
    if factor > _MAX_FACTOR:
        raise ValueError(f"must be at most {_MAX_FACTOR:g}, found {value}")
    return factor


Scale = Annotated[Factor | tuple[Factor, Factor, Factor], BeforeValidator(_scale)]
Height = Annotated[Metres, Field(ge=-MAX_LENGTH_M, le=MAX_LENGTH_M)]
_MIN_SAMPLES: Final = 2
File = Annotated[str, NamesFile(), Field(min_length=1)]


class MeshFile(FrozenModel):
    """A triangle mesh from a file; a body with a mass gets its convex hull, of uniform density.

    Its `pose` places the file's own origin; without z, the lowest point is on the ground. A fixed mesh may be
    hollow or open. A mesh that is not convex may have at most 40,000 triangles, or 20,000 on MuJoCo, which gets a piece
    of at most 5 mm behind each triangle. Corners are counter-clockwise as seen from the front. The `up_axis` of a
    .dae file is ignored.
    """

    file: Annotated[File, Field(description="a .stl, .obj or .dae file; the path is relative to the scenario")]
    scale: Annotated[
        Scale, Field(description="length in m of one unit of the file, also as [x, y, z] for each axis")
    ] = 1.0


class Heightfield(FrozenModel):
    """Terrain from a grid of heights, joined by triangles.

    Rows go from the highest y to the lowest, as in an image. The two triangles of a cell meet on the line from
    its lowest x and y to its highest. With `z: 0` in the `pose`, heights are world coordinates; without z, the lowest
    sample is on the ground: heights from -1 m to 2 m then reach up to 3 m. A robot that starts on the terrain needs its
    own z. At most 250,000 samples (500 x 500). A heightfield is fixed.
    """

    heights: Annotated[
        tuple[tuple[Height, ...], ...] | None,
        Field(description="rows from the highest y to the lowest, each from the lowest x to the highest"),
    ] = None
    image: Annotated[
        File | None,
        Field(description="alternative: a .pgm or grey .png file of 8 or 16 bits; black is low, white is high"),
    ] = None
    size: Annotated[tuple[Size, Size], Field(description="size in x and y, from the first sample to the last")]
    height: Annotated[Size | None, Field(description="height of white above black; only with 'image'")] = None

    @model_validator(mode="after")
    def _has_heights(self) -> Self:
        if (self.heights is None) == (self.image is None):
            raise ValueError("a heightfield needs either 'heights' or 'image'")
        if (self.image is None) != (self.height is None):
            raise ValueError(
                "'height' is the height of white in an 'image', which needs it; 'heights' are in m already"
            )
        lengths = [len(row) for row in self.heights or ()]
        if self.heights is not None and min([len(lengths), *lengths]) < _MIN_SAMPLES:
            raise ValueError("'heights' needs at least two rows with at least two samples each")
        odd = next((row for row, length in enumerate(lengths) if length != lengths[0]), None)
        if odd is not None:
            raise ValueError(
                f"'heights' has rows of different lengths: row 0 has {lengths[0]} samples, row {odd} has {lengths[odd]}"
            )
        return self


class OccupancyMap(FrozenModel):
    """Walls at the occupied cells of a map of ROS's map_server; free and unknown cells are empty.

    Of the map's YAML file, `image` (a PGM or grey PNG in the same folder), `resolution`, `origin`, `negate`,
    `occupied_thresh` and `free_thresh` are read; `mode` must be `trinary`. The body's `pose` moves the map's frame. At
    most 16 million cells and 2,000 boxes, into which cells are merged. A map is fixed.
    """

    file: Annotated[File, Field(description="the map's .yaml file; the path is relative to the scenario")]
    height: Annotated[Size, Field(description="height of the walls")] = 1.0


class ShapeError(ValueError):
    """An unusable shape; `key`: the key below it that causes this; `number`: its index in `shapes`, if any."""

    def __init__(self, message: str, key: str = "file") -> None:
        self.key = key
        self.number: int | None = None
        super().__init__(message)


def read_bytes(path: Path, name: str, most: int, key: str = "file") -> bytes:
    """Return the bytes of a file; `name`: as in the scenario. Raises ShapeError."""
    try:
        data = read_at_most(path, most)
    except OSError as error:
        raise ShapeError(f"'{name}' cannot be read: {error.strerror}", key) from None
    if data is None:
        raise ShapeError(f"'{name}' is larger than {most / 1e6:g} MB, the limit for this kind of file", key)
    return data


def found_file(workspace: Workspace, name: str, key: str = "file") -> Path:
    """Return the path of a file that a scenario names. Raises ShapeError."""
    try:
        return workspace.file(name)
    except PathError as error:
        raise ShapeError(str(error), key) from None
