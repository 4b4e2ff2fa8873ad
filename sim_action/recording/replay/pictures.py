"""The pictures of cameras in a replay: at most 2 per second and 160 x 120 pixels each, as PNG."""

from __future__ import annotations

import base64
import struct
import zlib
from collections.abc import Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field

from sim_action.core.field_types import FrozenModel
from sim_action.core.units import TIME_EPSILON_S
from sim_action.recording.replay.scans import MAX_SENSORS, SensorName
from sim_action.recording.replay.scene_data import Number
from sim_action.state.readings import CameraImage

if TYPE_CHECKING:
    from sim_action.sensors import ReadingLog

MAX_PICTURE_BYTES: Final = 300_000  # the largest size of all pictures of a replay
_MAX_WIDTH: Final = 160
_MAX_HEIGHT: Final = 120
_MAX_PICTURES: Final = 1_000
_MAX_TEXT: Final = 100_000  # a picture of the largest size that does not compress, with room
# A higher level saves little and takes several times as long.
_LEVEL: Final = 4
_SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"
_HEADER: Final = ">IIBBBBB"
_LEAST_BYTES: Final = 33  # the signature and the header with its checksum
_KIND: Final = (8, 2, 0, 0, 0)  # 8 bits for each of red, green and blue


def _checked(text: str) -> str:
    """Return the base64 of a small PNG; raise ValueError for anything else."""
    data = base64.b64decode(text, validate=True)
    if len(data) < _LEAST_BYTES or not data.startswith(_SIGNATURE + struct.pack(">I", 13) + b"IHDR"):
        raise ValueError("a picture is no PNG")
    width, height, *kind = struct.unpack_from(_HEADER, data, 16)
    if not (0 < width <= _MAX_WIDTH and 0 < height <= _MAX_HEIGHT and tuple(kind) == _KIND):
        raise ValueError(f"a picture has more than {_MAX_WIDTH} x {_MAX_HEIGHT} pixels, or another kind of colours")
    return text


Png = Annotated[str, Field(max_length=_MAX_TEXT), AfterValidator(_checked)]


class PictureData(FrozenModel):
    """A picture at a sim time in s: a PNG in base64."""

    time: Number
    png: Png


class CameraData(FrozenModel):
    """The pictures of one camera; one of `every` is kept, of those that were taken."""

    sensor: SensorName
    every: Annotated[int, Field(ge=1, le=1_000_000)] = 1
    pictures: Annotated[tuple[PictureData, ...], Field(min_length=1, max_length=_MAX_PICTURES)]

    @property
    def is_whole(self) -> bool:
        """True if the times rise."""
        times = [picture.time for picture in self.pictures]
        return all(later > earlier for earlier, later in pairwise(times))

    @property
    def size(self) -> int:
        """The size of all pictures in bytes."""
        return sum(len(picture.png) * 3 // 4 for picture in self.pictures)


def stored_pictures(logs: Mapping[str, ReadingLog], end: float) -> tuple[CameraData, ...]:
    """Return the pictures of all cameras up to a sim time in s, fewer if they would be too large."""
    found = []
    for log in logs.values():
        images = [
            image for image in log.readings if isinstance(image, CameraImage) and image.time <= end + TIME_EPSILON_S
        ]
        if images:
            found.append((log, images))
    budget = MAX_PICTURE_BYTES // max(1, len(found))
    return tuple(_camera(log, images, budget) for log, images in found[:MAX_SENSORS])


def _camera(log: ReadingLog, images: list[CameraImage], budget: int) -> CameraData:
    """Return the pictures of a camera that fit: all, or every n-th."""
    first = png_of(images[0].rgb)
    # Pictures of one camera have about the same size.
    every = max(1, -(-len(images) * len(first) * 5 // (4 * budget)), -(-len(images) // _MAX_PICTURES))
    packed = [first, *(png_of(image.rgb) for image in images[every::every])]
    while len(packed) > 1 and sum(map(len, packed)) > budget:
        packed, every = packed[::2], 2 * every
    pictures = tuple(
        PictureData.model_construct(time=round(image.time, 5), png=base64.b64encode(data).decode("ascii"))
        for image, data in zip(images[::every], packed, strict=True)
    )
    return CameraData.model_construct(sensor=log.mounted.name, every=every * log.every, pictures=pictures)


def png_of(rgb: NDArray[np.uint8]) -> bytes:
    """Return a picture (H, W, 3) as PNG, reduced to every n-th pixel if it is too large."""
    height, width, _ = rgb.shape
    step = max(1, -(-width // _MAX_WIDTH), -(-height // _MAX_HEIGHT))
    small = rgb[::step, ::step]
    height, width, _ = small.shape
    # Each row begins with its filter; pictures have large areas of one colour and need none.
    rows = np.zeros((height, 1 + 3 * width), dtype=np.uint8)
    rows[:, 1:] = small.reshape(height, 3 * width)
    header = struct.pack(_HEADER, width, height, *_KIND)
    return _SIGNATURE + b"".join(
        _chunk(name, data)
        for name, data in ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), _LEVEL)), (b"IEND", b""))
    )


def _chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
