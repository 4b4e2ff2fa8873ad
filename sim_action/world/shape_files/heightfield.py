"""Read heightfields: rows of heights or an image become a grid."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_action.core.workspace import Workspace
from sim_action.world import Heightfield
from sim_action.world.parts import GridPart
from sim_action.world.shape_files.grey_images import MAX_BYTES, ImageError, read_image
from sim_action.world.shape_files.shape_error import ShapeError, found_file, read_bytes

MAX_SAMPLES: Final = 250_000
"""500 x 500. PyBullet takes 0.5 s to load these, and crashes with a few million."""

_MIN_SAMPLES: Final = 2


def grid_of(heightfield: Heightfield, workspace: Workspace) -> GridPart:
    """Return the grid of a heightfield. Raises ShapeError."""
    rows = (
        _image(heightfield.image, heightfield.height or 0.0, workspace)
        if heightfield.image is not None
        else np.array(heightfield.heights, dtype=np.float64)
    )
    # The first row of the file has the highest y.
    return GridPart(heightfield.size, np.ascontiguousarray(rows[::-1]))


def _image(name: str, height: float, workspace: Workspace) -> NDArray[np.float64]:
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
