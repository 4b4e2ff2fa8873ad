"""Grey images: PGM and PNG, of 8 or 16 bits, bounded before anything is unpacked."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

MAX_PIXELS: Final = 16_000_000
"""Of an image: 4,000 x 4,000, which a map of 200 m at 5 cm has."""

MAX_BYTES: Final = 4 * MAX_PIXELS
"""Of a file: what that many pixels need as text, if most are of three digits."""


class ImageError(ValueError):
    """An image that cannot be used; its text goes on where a file's name ends."""


@dataclass(frozen=True, eq=False)
class Grey:
    """An image.

    Attributes:
        pixels: (H, W), row 0 at the top.
        white: what a white pixel has; black is 0.
    """

    pixels: NDArray[np.uint16]
    white: int


def read_image(data: bytes) -> Grey:
    """Reads the bytes of a file; what it is, it says itself. Raises ImageError."""
    if data[:2] in (b"P2", b"P5"):
        from sim_action.world.imports.pgm import read_pgm

        return read_pgm(data)
    if data[:8] == b"\x89PNG\r\n\x1a\n":
        from sim_action.world.imports.png import read_png

        return read_png(data)
    if data.startswith(b"version https://git-lfs"):
        raise ImageError("is a pointer of Git LFS, not the image; fetch it: git lfs pull")
    raise ImageError("is no PGM (P2 or P5) and no PNG; convert it to one of these, in grey")


def checked_size(width: int, height: int) -> None:
    """Raises ImageError if an image of this size is not read."""
    if width < 1 or height < 1:
        raise ImageError(f"says that it has {width} x {height} pixels")
    if width * height > MAX_PIXELS:
        raise ImageError(f"says that it has {width} x {height} pixels; at most {MAX_PIXELS:,} are read; scale it down")
