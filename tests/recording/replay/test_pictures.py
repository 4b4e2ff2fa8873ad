"""The pictures of a replay: small PNG files, fewer of them where they would be too large."""

from __future__ import annotations

import base64
import math
import struct
import zlib

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from sim_action.recording.replay.pictures import MAX_PICTURE_BYTES, PictureData, png_of, stored_pictures
from sim_action.sensors.camera import Camera
from sim_action.state.readings import CameraImage
from tests.recording.replay import logs


def image(time: float, rgb: NDArray[np.uint8]) -> CameraImage:
    return CameraImage(time, rgb, np.full(rgb.shape[:2], math.inf, dtype=np.float32))


def noise(count: int, height: int = 120, width: int = 160) -> list[CameraImage]:
    random = np.random.default_rng(0)
    return [image(number / 2, random.integers(0, 256, (height, width, 3), dtype=np.uint8)) for number in range(count)]


def pixels(png: bytes) -> NDArray[np.uint8]:
    """The pixels of a PNG without filters, as `png_of` writes it."""
    width, height = struct.unpack_from(">II", png, 16)
    length = struct.unpack_from(">I", png, 33)[0]
    rows = np.frombuffer(zlib.decompress(png[41 : 41 + length]), dtype=np.uint8).reshape(height, -1)
    assert not rows[:, 0].any()
    return rows[:, 1:].reshape(height, width, 3)


@pytest.mark.parametrize(("size", "step"), [((120, 160), 1), ((3, 5), 1), ((480, 640), 4), ((100, 300), 2)])
def test_a_picture_keeps_its_pixels_or_every_nth(size: tuple[int, int], step: int) -> None:
    (taken,) = noise(1, *size)
    np.testing.assert_array_equal(pixels(png_of(taken.rgb)), taken.rgb[::step, ::step])


def test_pictures_are_stored_with_their_times() -> None:
    plain = np.full((120, 160, 3), 7, dtype=np.uint8)
    log = logs.log(Camera(), "eye", [image(number / 2, plain) for number in range(5)], rate=2.0)
    (found,) = stored_pictures({"eye": log}, 1.5)
    assert (found.sensor, found.every, [picture.time for picture in found.pictures]) == ("eye", 1, [0.0, 0.5, 1.0, 1.5])
    np.testing.assert_array_equal(pixels(base64.b64decode(found.pictures[0].png)), plain)
    assert type(found).model_validate_json(found.model_dump_json()) == found


def test_pictures_that_are_too_large_are_left_out() -> None:
    log = logs.log(Camera(), "eye", noise(20), rate=2.0)
    (found,) = stored_pictures({"eye": log}, 100.0)
    assert found.every > 1
    assert found.size <= MAX_PICTURE_BYTES
    assert [picture.time for picture in found.pictures] == [number / 2 for number in range(0, 20, found.every)]


def test_other_sensors_take_no_pictures() -> None:
    assert stored_pictures({"front": logs.lidar("front", 3, lambda _: [1.0])}, 1.0) == ()


GOOD = png_of(np.zeros((2, 2, 3), dtype=np.uint8))


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"GIF89a" + GOOD,
        b"<svg onload=alert(1)>",
        GOOD[:20],
        GOOD.replace(struct.pack(">II", 2, 2), struct.pack(">II", 2, 100_000)),
        GOOD.replace(struct.pack(">II", 2, 2), struct.pack(">II", 0, 2)),
        GOOD + bytes(100_000),
        GOOD.replace(bytes((8, 2, 0, 0, 0)), bytes((16, 6, 0, 0, 0))),
    ],
    ids=["nothing", "another format", "vectors", "cut off", "high", "narrow", "large", "deep colours"],
)
def test_what_is_no_small_picture_is_refused(data: bytes) -> None:
    with pytest.raises(ValidationError):
        PictureData.model_validate({"time": 0.0, "png": base64.b64encode(data).decode()})


@pytest.mark.parametrize("text", ["", "no base64!", "data:image/png;base64,AAAA", '"><script>'])
def test_what_is_no_base64_is_refused(text: str) -> None:
    with pytest.raises(ValidationError):
        PictureData.model_validate({"time": 0.0, "png": text})
