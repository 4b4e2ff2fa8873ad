"""The readings that a replay shows: scans of lidars and pictures of cameras.

There are at most 5 scans per second of 360 rays each, in whole steps of 1 cm, and at most 2 pictures per second of
160 x 120 pixels each, as PNG.
"""

from __future__ import annotations

import base64
import math
import struct
import zlib
from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field

from sim_action.core.field_types import FrozenModel
from sim_action.core.units import TIME_EPSILON_S
from sim_action.recording.replay.columns import Column, FloatArray, Index, Scale
from sim_action.recording.replay.scene_data import Length, Number, PoseNumbers, numbers
from sim_action.state.readings import CameraImage, LidarScan, Reading

if TYPE_CHECKING:
    from sim_action.sensors import ReadingLog


MAX_SENSORS: Final = 20
MAX_RAYS: Final = 360
MAX_RANGES: Final = 300_000  # the largest number of ranges in a replay; each takes about one byte when packed
NOTHING: Final = -1  # the step of a ray without a return
TOO_NEAR: Final = -2  # the step of a ray whose surface is nearer than the sensor can measure
_MAX_RATE: Final = 5.0
# Below this rate, rays are left out before further scans.
_MIN_RATE: Final = 1.0
_STEP_M: Final = 0.01
_MAX_STEPS: Final = 100_000  # a range has at most so many steps
SensorName = Annotated[str, Field(min_length=1, max_length=300)]


class ScanData(FrozenModel):
    """The scans of one lidar."""

    sensor: SensorName
    link: Index  # the index of the link that carries the sensor
    pose: PoseNumbers  # the pose of the sensor in the frame of the link; rays lie in its x-y plane
    first_angle: Number  # the angle of the first ray in rad, counter-clockwise from the x axis
    increment: Number  # the angle between two rays in rad
    rays: Annotated[int, Field(ge=1, le=MAX_RAYS)]  # the number of rays of a scan
    range: Length  # the largest measured distance in m
    time: Column  # the sim times of the scans in s
    scale: Scale  # the size of a step of the ranges in m
    # the steps of the first scan, then the differences of each scan from the one before; -1 is a ray without a return,
    # -2 a surface that is too near
    ranges: Annotated[tuple[Annotated[int, Field(ge=-200_000, le=200_000)], ...], Field(max_length=MAX_RANGES)]
    every_scan: Annotated[int, Field(ge=1, le=1_000_000)] = 1  # one of so many scans is kept
    every_ray: Annotated[int, Field(ge=1, le=1_000_000)] = 1  # one of so many rays is kept

    @property
    def count(self) -> int:
        """The number of scans."""
        return 1 + len(self.time.deltas)

    @property
    def is_whole(self) -> bool:
        """True if the times rise and all scans are complete."""
        return self.time.rises and len(self.ranges) == self.count * self.rays

    def decoded(self) -> FloatArray:
        """Return the ranges (S, R) in m; inf without a return, -inf if too near."""
        steps = np.cumsum(np.array(self.ranges, dtype=np.int64).reshape(self.count, self.rays), axis=0)
        ranges = self.scale * steps.astype(np.float64)
        ranges[steps == NOTHING], ranges[steps == TOO_NEAR] = math.inf, -math.inf
        return ranges


def scans_until(log: ReadingLog, end: float) -> list[LidarScan]:
    """Return the scans of a log up to a sim time in s; none if its sensor makes no scans."""
    scans: list[LidarScan] = []
    for reading in log.readings:
        if not isinstance(reading, LidarScan):
            return []
        if reading.time <= end + TIME_EPSILON_S:
            scans.append(reading)
    return scans


def stored_scans(
    logs: Mapping[str, ReadingLog], links: Mapping[str, int], root: str, end: float, rate: float
) -> tuple[ScanData, ...]:
    """Return the scans of all lidars for storage.

    `links` maps link names to indices, `root` is the base link, `end` the end of the run in s, `rate` the physics
    rate in Hz.
    """
    several = [(log, scans) for log in logs.values() if (scans := scans_until(log, end))][:MAX_SENSORS]
    shown = [(log, scans, links.get(log.mounted.link or root)) for log, scans in several]
    budget = MAX_RANGES // max(1, len(shown))
    return tuple(_scan_data(log, scans, link, budget, rate) for log, scans, link in shown if link is not None)


def _scan_data(log: ReadingLog, scans: list[LidarScan], link: int, budget: int, rate: float) -> ScanData:
    first = scans[0]
    every_scan, every_ray = thinning(log.mounted.rate / log.every, len(scans), len(first.ranges), budget)
    kept = scans[::every_scan]
    ranges = np.array([scan.ranges[::every_ray] for scan in kept])
    scale = max(_STEP_M, float(f"{first.range_max / _MAX_STEPS:.1g}"))
    x, y, z = numbers(log.mounted.pose.position_xyz)
    qx, qy, qz, qw = numbers(log.mounted.pose.orientation_xyzw)
    measured = np.isfinite(ranges)
    steps = np.rint(np.where(measured, ranges, 0.0) / scale).astype(np.int64)
    steps[~measured] = np.where(ranges[~measured] < 0, TOO_NEAR, NOTHING)
    return ScanData.model_construct(
        sensor=log.mounted.name,
        link=link,
        pose=(x, y, z, qx, qy, qz, qw),
        first_angle=first.angle_min,
        increment=first.angle_increment * every_ray,
        rays=ranges.shape[1],
        range=first.range_max,
        time=Column.encoded(times_of(kept), 1 / rate),
        scale=scale,
        ranges=tuple(np.diff(steps, axis=0, prepend=0).ravel().tolist()),
        every_scan=every_scan * log.every,
        every_ray=every_ray,
    )


def times_of(readings: Iterable[Reading]) -> FloatArray:
    """Return the times (N,) of readings in s."""
    return np.array([reading.time for reading in readings], dtype=np.float64)


def thinning(rate: float, scans: int, rays: int, budget: int) -> tuple[int, int]:
    """Return which part of scans, then rays, is kept, at `rate` Hz within a `budget` of ranges."""
    every_scan = max(1, math.ceil(rate / _MAX_RATE - 1e-9))
    every_ray = -(-rays // MAX_RAYS)
    while True:
        kept_scans, kept_rays = -(-scans // every_scan), -(-rays // every_ray)
        if kept_scans * kept_rays <= budget:
            return every_scan, every_ray
        if rate / (every_scan + 1) >= _MIN_RATE or kept_rays == 1:
            every_scan += 1
        else:
            every_ray += 1


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
    """The pictures of one camera; one of `every` taken pictures is kept."""

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
    cameras = []
    for log in logs.values():
        images = [
            image for image in log.readings if isinstance(image, CameraImage) and image.time <= end + TIME_EPSILON_S
        ]
        if images:
            cameras.append((log, images))
    budget = MAX_PICTURE_BYTES // max(1, len(cameras))
    return tuple(_camera(log, images, budget) for log, images in cameras[:MAX_SENSORS])


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
