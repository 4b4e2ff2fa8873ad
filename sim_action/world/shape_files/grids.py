"""Read occupancy maps of ROS's map_server (its documentation, section 3) and heightfields.

A YAML file and an image become walls; rows of heights or an image become a grid.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, ValidationError

from sim_action.core import geometry
from sim_action.core.errors import InvalidScenario
from sim_action.core.field_types import FrozenModel
from sim_action.core.geometry import Pose
from sim_action.core.records import replace
from sim_action.core.wording import escaped_line
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import read_document
from sim_action.core.yaml_errors import spec_errors
from sim_action.world import Heightfield, OccupancyMap
from sim_action.world.parts import BoxPart, GridPart
from sim_action.world.shape_files.grey_images import MAX_BYTES, Grey, ImageError, read_image
from sim_action.world.shape_files.shape_error import ShapeError, found_file, read_bytes

MAX_WALLS: Final = 2_000
"""Limit of boxes. An office of 50 m has a few hundred."""

_MAX_YAML: Final = 100_000

Metres = Annotated[float, Field(ge=-1e5, le=1e5)]
Share = Annotated[float, Field(ge=0, le=1)]


def _as_number(value: object) -> object:
    return int(value) if isinstance(value, bool) else value


class MapFile(FrozenModel):
    """The keys of a map's YAML file; lengths in m, the yaw in rad."""

    image: Annotated[str, Field(min_length=1)]
    resolution: Annotated[float, Field(ge=1e-3, le=100)]
    origin: tuple[Metres, Metres, Annotated[float, Field(ge=-1e3, le=1e3)]]
    negate: Annotated[int, Field(ge=0, le=1), BeforeValidator(_as_number)] = 0
    occupied_thresh: Share = 0.65
    free_thresh: Share = 0.196
    mode: str = "trinary"


def walls(occupancy: OccupancyMap, workspace: Workspace) -> Iterator[BoxPart]:
    """Yield the walls of a map in the map's frame, from z = 0 up. Raises ShapeError."""
    name = occupancy.file
    path = found_file(workspace, name)
    said = _map_file(name, read_bytes(path, name, _MAX_YAML))
    beside = replace(workspace, directory=path.parent)
    occupied = _occupied(said, _image(said.image, name, beside))
    if not occupied.any():
        raise ShapeError(
            f"'{name}' has no occupied cell: no pixel of '{said.image}' is dark enough for 'occupied_thresh'"
        )
    # Row 0 of an image is at the top.
    found = rectangles(occupied[::-1], MAX_WALLS)
    if found is None:
        raise ShapeError(
            f"'{name}' needs more than {MAX_WALLS:,} boxes after merging adjacent cells; "
            "remove isolated cells, or use a coarser resolution"
        )
    for cells in found:
        yield _wall(cells, said, occupancy.height)


def _wall(cells: Rectangle, said: MapFile, height: float) -> BoxPart:
    x, y, yaw = said.origin
    origin = Pose((x, y, height / 2), geometry.quaternion_from_rpy(0.0, 0.0, math.remainder(yaw, math.tau)))
    left, right, low, high = (cell * said.resolution for cell in cells)
    middle = Pose(((left + right) / 2, (low + high) / 2, 0.0))
    return BoxPart((right - left, high - low, height), geometry.compose(origin, middle))


def _map_file(name: str, data: bytes) -> MapFile:
    try:
        document = read_document(name, data.decode("utf-8"))
    except UnicodeDecodeError:
        raise ShapeError(f"'{name}' is not UTF-8 text; is it the map's .yaml?") from None
    except InvalidScenario as error:
        raise ShapeError(escaped_line("; ".join(map(str, error.problems)))) from None
    keys: Any = document.data
    if not isinstance(keys, dict):
        raise ShapeError(f"'{name}' has no keys; a map_server file needs 'image:', 'resolution:' and 'origin:'")
    known = {key: value for key, value in keys.items() if key in MapFile.model_fields}
    try:
        said = MapFile.model_validate(known)
    except ValidationError as error:
        found = [document.problem(path, message) for path, message in spec_errors(MapFile, known, error)]
        raise ShapeError("; ".join(map(str, found))) from None
    if said.mode != "trinary":
        raise ShapeError(str(document.problem(("mode",), f"'{said.mode}' is not supported; use 'trinary'")))
    if said.free_thresh > said.occupied_thresh:
        raise ShapeError(str(document.problem(("free_thresh",), "must not be above 'occupied_thresh'")))
    return said


def _image(image: str, name: str, beside: Workspace) -> Grey:
    try:
        return read_image(read_bytes(found_file(beside, image), image, MAX_BYTES))
    except ShapeError as error:
        raise ShapeError(f"{name}: image: {error}", error.key) from None
    except ImageError as error:
        raise ShapeError(f"'{image}', the image of '{name}', {error}") from None


def _occupied(said: MapFile, image: Grey) -> NDArray[np.bool_]:
    shades = np.arange(image.white + 1) / image.white
    probability = shades if said.negate else 1.0 - shades
    occupied: NDArray[np.bool_] = (probability > said.occupied_thresh)[image.pixels]
    return occupied


class Rectangle(NamedTuple):
    """A range of cells; the columns end before `right`, the rows before `high`."""

    left: int
    right: int
    low: int
    high: int


def rectangles(cells: NDArray[np.bool_], most: int) -> list[Rectangle] | None:
    """Return rectangles that cover the set cells (rows, columns) exactly once; None if there are more than `most`.

    Adjacent cells of a row are merged, then equal runs of adjacent rows. Both orientations are tried.
    """
    along = _merged(cells, most)
    across = _merged(cells.T, most)
    if across is not None and (along is None or len(across) < len(along)):
        return [Rectangle(low, high, left, right) for left, right, low, high in across]
    return along


def _merged(cells: NDArray[np.bool_], most: int) -> list[Rectangle] | None:
    found: list[Rectangle] = []
    begun: dict[tuple[int, int], int] = {}
    last = -1
    for row, runs in _runs(cells):
        if row != last + 1:
            found += _closed(begun, {}, last + 1)
        found += _closed(begun, runs, row)
        for run in runs:
            begun.setdefault(run, row)
        last = row
        if len(found) + len(begun) > most:
            return None
    return [*found, *_closed(begun, {}, last + 1)]


def _closed(begun: dict[tuple[int, int], int], runs: dict[tuple[int, int], None], row: int) -> Iterator[Rectangle]:
    ended = [run for run in begun if run not in runs]
    return iter([Rectangle(*run, begun.pop(run), row) for run in ended])


def _runs(cells: NDArray[np.bool_]) -> Iterator[tuple[int, dict[tuple[int, int], None]]]:
    """Yield each row that has set cells, with the start and end of each run."""
    for row in np.flatnonzero(cells.any(axis=1)).tolist():
        padded = np.concatenate(([False], cells[row], [False]))
        edges = np.flatnonzero(padded[1:] != padded[:-1]).tolist()
        yield row, dict.fromkeys(zip(edges[::2], edges[1::2], strict=True))


MAX_SAMPLES: Final = 250_000
"""500 x 500. PyBullet takes 0.5 s to load these, and crashes with a few million."""

_MIN_SAMPLES: Final = 2


def grid_of(heightfield: Heightfield, workspace: Workspace) -> GridPart:
    """Return the grid of a heightfield. Raises ShapeError."""
    rows = (
        _heights(heightfield.image, heightfield.height or 0.0, workspace)
        if heightfield.image is not None
        else np.array(heightfield.heights, dtype=np.float64)
    )
    # The first row of the file has the highest y.
    return GridPart(heightfield.size, np.ascontiguousarray(rows[::-1]))


def _heights(name: str, height: float, workspace: Workspace) -> NDArray[np.float64]:
    data = read_bytes(found_file(workspace, name, "image"), name, MAX_BYTES, "image")
    try:
        image = read_image(data)
    except ImageError as error:
        raise ShapeError(f"'{name}' {error}", "image") from None
    rows, columns = image.pixels.shape
    if min(rows, columns) < _MIN_SAMPLES:
        raise ShapeError(f"'{name}' has {columns} x {rows} pixels; it needs at least 2 x 2", "image")
    if rows * columns > MAX_SAMPLES:
        found = f"'{name}' has {columns} x {rows} pixels; at most {MAX_SAMPLES:,} samples are simulated"
        raise ShapeError(f"{found}: scale it down", "image")
    return image.pixels.astype(np.float64) * (height / image.white)
