"""The scans of a replay: what is read is what was stored, to a centimetre, and long runs have fewer of them."""

from __future__ import annotations

import base64
import math
import struct
import zlib
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from sim_action.recording.replay.sensor_data import (
    MAX_PICTURE_BYTES,
    MAX_RANGES,
    PictureData,
    ScanData,
    png_of,
    stored_pictures,
    stored_scans,
    thinning,
)
from sim_action.sensors import ReadingLog
from sim_action.sensors.camera import Camera
from sim_action.state.readings import CameraImage
from tests.outcomes import like
from tests.recording.replay import logs

LINKS = {"base_footprint": 0, "base_scan": 1}
RATE = 240.0


def stored(*several: ReadingLog, end: float = 100.0) -> tuple[ScanData, ...]:
    return stored_scans({log.mounted.name: log for log in several}, LINKS, "base_footprint", end, RATE)


def test_scans_are_stored_and_thinned() -> None:
    # Scans are stored to a centimetre.
    (found,) = stored(logs.lidar("front", 3, lambda time: [1.0 + time, math.inf, -math.inf, 2.345], rate=5.0))
    assert (found.sensor, found.link, found.rays, found.count) == ("front", 0, 4, 3)
    assert (found.every_scan, found.every_ray) == (1, 1)
    assert found.is_whole
    np.testing.assert_allclose(found.time.decoded(3), [0.0, 0.2, 0.4])
    expected = [[1.0 + time, math.inf, -math.inf, 2.345] for time in (0.0, 0.2, 0.4)]
    np.testing.assert_allclose(found.decoded(), expected, atol=0.0051)
    assert ScanData.model_validate_json(found.model_dump_json()) == found
    # A fast lidar keeps five scans per second.
    (found,) = stored(logs.lidar("front", 41, lambda _: [1.0], rate=40.0))
    assert found.every_scan == 8
    np.testing.assert_allclose(found.time.decoded(found.count), [0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
    # Scans after the end and other sensors are left out.
    (found,) = stored(logs.lidar("front", 10, lambda _: [1.0], rate=5.0), logs.bumper("bumper", {}), end=0.4)
    assert found.count == 3


@pytest.mark.parametrize(
    ("rate", "scans", "rays", "budget", "expected"),
    [
        (5.0, 50, 360, MAX_RANGES, (1, 1)),
        (10.0, 100, 360, MAX_RANGES, (2, 1)),
        (10.0, 100, 1080, MAX_RANGES, (2, 3)),
        (10.0, 6_000, 360, MAX_RANGES, (8, 1)),
        # Below one scan per second, rays are left out.
        (10.0, 20_000, 360, MAX_RANGES, (10, 3)),
        (1.0, 10_000, 1, 5_000, (2, 1)),
    ],
)
def test_scans_are_thinned_first(rate: float, scans: int, rays: int, budget: int, expected: tuple[int, int]) -> None:
    assert thinning(rate, scans, rays, budget) == expected
    every_scan, every_ray = expected
    assert -(-scans // every_scan) * -(-rays // every_ray) <= budget


@pytest.mark.parametrize(
    "change",
    [
        {"rays": 0},
        {"rays": 361},
        {"ranges": [1] * (MAX_RANGES + 1)},
        {"ranges": [1e9]},
        {"ranges": [300_000]},
        {"scale": 0},
        {"pose": [0, 0, 0]},
        {"range": math.inf},
        {"every_scan": 0},
        {"more": 1},
    ],
)
def test_what_no_lidar_stores_is_refused(change: dict[str, Any]) -> None:
    (found,) = stored(logs.lidar("front", 1, lambda _: [1.0]))
    with pytest.raises(ValidationError):
        ScanData.model_validate(found.model_dump() | change)


@pytest.mark.parametrize("change", [{"ranges": (1, 2)}, {"rays": 2}])
def test_scans_that_are_not_complete_are_noticed(change: dict[str, Any]) -> None:
    (found,) = stored(logs.lidar("front", 1, lambda _: [1.0]))
    assert not like(found, **change).is_whole


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


def test_pictures_are_stored_within_their_size() -> None:
    # Pictures are stored with their times.
    plain = np.full((120, 160, 3), 7, dtype=np.uint8)
    log = logs.log(Camera(), "eye", [image(number / 2, plain) for number in range(5)], rate=2.0)
    (found,) = stored_pictures({"eye": log}, 1.5)
    assert (found.sensor, found.every, [picture.time for picture in found.pictures]) == ("eye", 1, [0.0, 0.5, 1.0, 1.5])
    np.testing.assert_array_equal(pixels(base64.b64decode(found.pictures[0].png)), plain)
    assert type(found).model_validate_json(found.model_dump_json()) == found
    # Pictures that are too large are left out.
    log = logs.log(Camera(), "eye", noise(20), rate=2.0)
    (found,) = stored_pictures({"eye": log}, 100.0)
    assert found.every > 1
    assert found.size <= MAX_PICTURE_BYTES
    assert [picture.time for picture in found.pictures] == [number / 2 for number in range(0, 20, found.every)]
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
def test_what_is_no_small_picture_or_no_base64_is_refused(data: bytes) -> None:
    for text in (base64.b64encode(data).decode(), "no base64!", "data:image/png;base64,AAAA", '"><script>'):
        with pytest.raises(ValidationError):
            PictureData.model_validate({"time": 0.0, "png": text})
