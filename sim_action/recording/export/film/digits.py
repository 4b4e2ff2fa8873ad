"""Numbers drawn into a picture, without a font."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

# Five rows of three pixels, as bits.
_SIGNS: Final = {
    "0": (7, 5, 5, 5, 7),
    "1": (2, 6, 2, 2, 7),
    "2": (7, 1, 7, 4, 7),
    "3": (7, 1, 7, 1, 7),
    "4": (5, 5, 7, 1, 1),
    "5": (7, 4, 7, 1, 7),
    "6": (7, 4, 7, 5, 7),
    "7": (7, 1, 1, 1, 1),
    "8": (7, 5, 7, 5, 7),
    "9": (7, 5, 7, 1, 7),
    ".": (0, 0, 0, 0, 2),
    "s": (0, 7, 6, 3, 7),
    "x": (0, 5, 2, 5, 0),
    " ": (0, 0, 0, 0, 0),
}
_SCALE: Final = 3
_MARGIN: Final = 4


def write(picture: NDArray[np.uint8], text: str) -> None:
    """Writes digits, points, "s" and "x" into the upper left corner of (H, W, 3): white on black."""
    rows = np.zeros((7, 4 * len(text) + 1), dtype=bool)
    for place, sign in enumerate(text):
        bits = np.array(_SIGNS[sign])[:, None] >> np.array((2, 1, 0)) & 1
        rows[1:6, 4 * place + 1 : 4 * place + 4] = bits
    large = rows.repeat(_SCALE, axis=0).repeat(_SCALE, axis=1)
    height, width = large.shape
    picture[_MARGIN : _MARGIN + height, _MARGIN : _MARGIN + width] = np.where(large, 255, 0)[..., None]
