"""Read occupancy maps of ROS's map_server (its documentation, section 3) and heightfields.

A YAML file and an image become walls; rows of heights or an image become a grid.
Images are grey: PGM (P2, P5) and PNG (third edition) of 8 or 16 bits, with size limits before unpacking.
"""

from __future__ import annotations

import math
import re
import struct
import zlib
from collections.abc import Iterator
from typing import Annotated, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, ValidationError

from sim_action.core import geometry
from sim_action.core.errors import InvalidScenario
from sim_action.core.field_types import FrozenModel, spec_errors
from sim_action.core.geometry import Pose
from sim_action.core.records import dataclass, replace
from sim_action.core.wording import escaped_line
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import read_document
from sim_action.world import Heightfield, OccupancyMap
from sim_action.world.parts import BoxPart, GridPart
from sim_action.world.shapes import ShapeError, found_file, read_bytes

MAX_PIXELS: Final = 16_000_000  # 4,000 x 4,000 pixels: a map of 200 m at 5 cm
MAX_BYTES: Final = 4 * MAX_PIXELS  # the file size of that many pixels as text of three digits


class ImageError(ValueError):
    """An unusable image; the message continues a sentence that starts with the file's name."""


@dataclass(frozen=True, eq=False)
class Grey:
    """A grey image."""

    pixels: NDArray[np.uint16]  # (H, W), row 0 at the top
    white: int  # value of a white pixel; black is 0


def read_image(data: bytes) -> Grey:
    """Read the bytes of a file; the format is detected from its content. Raises ImageError."""
    if data[:2] in (b"P2", b"P5"):
        return read_pgm(data)
    if data[:8] == b"\x89PNG\r\n\x1a\n":
        return read_png(data)
    if data.startswith(b"version https://git-lfs"):
        raise ImageError("is a Git LFS pointer, not the image; fetch it: git lfs pull")
    raise ImageError("is neither a PGM (P2 or P5) nor a PNG; convert it to one of these, in grey")


def checked_size(width: int, height: int) -> None:
    """Raise ImageError if an image of this size is not read."""
    if width < 1 or height < 1:
        raise ImageError(f"has a size of {width} x {height} pixels in its header")
    if width * height > MAX_PIXELS:
        raise ImageError(f"has {width} x {height} pixels in its header; at most {MAX_PIXELS:,} are read; scale it down")


# Width, height and the value of white, with comments in between; one whitespace ends the header.
_BLANK: Final = rb"(?:\s|#[^\n]*\n)+"
_NUMBER: Final = rb"(\d{1,9})"
_HEADER: Final = re.compile(rb"(P[25])" + 3 * (_BLANK + _NUMBER) + rb"\s")
_COMMENT: Final = re.compile(rb"#[^\n]*")
_MAX_WHITE: Final = 65_535
_AT_A_TIME: Final = 100_000
_ONE_BYTE: Final = 256


def read_pgm(data: bytes) -> Grey:
    """Read the bytes of a file. Raises ImageError."""
    header = _HEADER.match(data[:10_000])
    if header is None:
        raise ImageError("is not a valid PGM: its header lacks width, height or the value of white")
    width, height, white = (int(header[number]) for number in (2, 3, 4))
    checked_size(width, height)
    if not 0 < white <= _MAX_WHITE:
        raise ImageError(f"has a value of white of {white} in its header; allowed: 1 to {_MAX_WHITE}")
    is_text = header[1] == b"P2"
    read = _text(data, header.end(), width * height) if is_text else _bytes(data[header.end() :], white, width * height)
    if len(read) < width * height:
        raise ImageError(
            f"is cut off: {width} x {height} pixels need {width * height:,} values, and it has {len(read):,}"
        )
    pixels = np.minimum(read[: width * height], white).astype(np.uint16)
    return Grey(pixels.reshape(height, width), white)


def _bytes(data: bytes, white: int, count: int) -> NDArray[np.uint16]:
    if white < _ONE_BYTE:
        return np.frombuffer(data[:count], np.uint8).astype(np.uint16)
    return np.frombuffer(data[: min(2 * count, len(data) // 2 * 2)], ">u2").astype(np.uint16)


def _text(data: bytes, at: int, count: int) -> NDArray[np.uint16]:
    """Return up to `count` pixels; it reads block by block, because Python strings take 20 times the memory."""
    read = [np.empty(0, np.uint16)]
    while at < len(data) and count > 0:
        end = data.find(b"\n", at + _AT_A_TIME) + 1 or len(data)
        words = _COMMENT.sub(b"", data[at:end]).split(maxsplit=count)[:count]
        try:
            values = np.array(words, dtype=np.int64)
        except (ValueError, OverflowError):
            raise ImageError("has a pixel that is not a whole number") from None
        if len(values) and values.min() < 0:
            raise ImageError("has a pixel below 0")
        read.append(np.minimum(values, _MAX_WHITE).astype(np.uint16))
        at, count = end, count - len(words)
    return np.concatenate(read)


_SIGNATURE_BYTES: Final = 8
_COLOUR_TYPES: Final = {0: "grey", 2: "colour", 3: "a palette", 4: "grey with transparency", 6: "colour"}
_MAX_FILTER_TYPE: Final = 4
Bytes = NDArray[np.int16]


def read_png(data: bytes) -> Grey:
    """Read the bytes of a file. Raises ImageError."""
    chunks = _chunks(data)
    kind, header = next(chunks, (b"", b""))
    if kind != b"IHDR" or len(header) != struct.calcsize(">IIBBBBB"):
        raise ImageError("is not a valid PNG: it does not start with a header")
    width, height, bits, colour, _, _, interlaced = struct.unpack(">IIBBBBB", header)
    checked_size(width, height)
    if colour != 0 or bits not in (8, 16) or interlaced:
        variant = f"{_COLOUR_TYPES.get(colour, 'unknown')}, {bits} bits{', interlaced' if interlaced else ''}"
        raise ImageError(f"is a PNG of an unsupported kind ({variant}); save it in grey, 8 or 16 bits, not interlaced")
    stride = width * bits // 8
    packed = b"".join(body for kind, body in chunks if kind == b"IDAT")
    rows = _unfiltered(_unpacked(packed, (stride + 1) * height), height, stride, bits // 8)
    pixels = rows.view(">u2") if bits == 16 else rows
    return Grey(pixels.astype(np.uint16), 2**bits - 1)


def _chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    at = _SIGNATURE_BYTES
    while at < len(data):
        if len(data) < at + 12:
            raise ImageError("is cut off")
        (length,) = struct.unpack_from(">I", data, at)
        kind, body = data[at + 4 : at + 8], data[at + 8 : at + 8 + length]
        at += 12 + length
        if len(data) < at or zlib.crc32(kind + body) != struct.unpack_from(">I", data, at - 4)[0]:
            raise ImageError("is damaged, or was cut off")
        yield kind, body
        if kind == b"IEND":
            return
    raise ImageError("is cut off")


def _unpacked(packed: bytes, size: int) -> bytes:
    """Unpack at most `size` bytes."""
    try:
        data = zlib.decompressobj().decompress(packed, size)
    except zlib.error:
        raise ImageError("is damaged: its pixels cannot be decompressed") from None
    if len(data) < size:
        raise ImageError("is damaged: it has fewer pixels than its header states")
    return data


def _unfiltered(data: bytes, height: int, stride: int, step: int) -> NDArray[np.uint8]:
    """Undo the row filters and return (H, stride) bytes.

    A byte depends on its left, upper and upper left neighbours. All of these lie on the two previous diagonals, so the
    bytes are computed diagonal by diagonal.
    """
    filtered = np.frombuffer(data, np.uint8).reshape(height, stride + 1)
    kinds = filtered[:, :1]
    if kinds.max() > _MAX_FILTER_TYPE:
        raise ImageError(f"is damaged: a row has the unknown filter type {kinds.max()}")
    columns = stride // step
    framed = np.zeros((height + 1, columns + 1, step), np.int16)
    framed[1:, 1:] = filtered[:, 1:].reshape(height, columns, step)
    flat = framed.reshape(-1, step)
    for diagonal in range(height + columns - 1):
        top, bottom = max(0, diagonal - columns + 1), min(height - 1, diagonal)
        count, start = bottom - top + 1, (top + 1) * (columns + 1) + diagonal - top + 1
        current, left, up, corner = (
            flat[at : at + (count - 1) * columns + 1 : columns]
            for at in (start, start - 1, start - columns - 1, start - columns - 2)
        )
        current += _predicted(kinds[top : bottom + 1], left, up, corner)
        current &= 255
    return framed[1:, 1:].reshape(height, stride).astype(np.uint8)


def _predicted(kinds: NDArray[np.uint8], left: Bytes, up: Bytes, corner: Bytes) -> Bytes:
    """Return the predictions (N, step) for filter types 0 to 4: none, left, up, average, Paeth."""
    to_left, to_up, to_corner = abs(up - corner), abs(left - corner), abs(left + up - 2 * corner)
    nearest = np.where(to_up <= to_corner, up, corner)
    paeth = np.where((to_left <= to_up) & (to_left <= to_corner), left, nearest)
    predicted: Bytes = np.choose(kinds, np.stack((np.zeros_like(left), left, up, (left + up) // 2, paeth)))
    return predicted


MAX_WALLS: Final = 2_000  # Limit of boxes. An office of 50 m has a few hundred.
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
    image = _image(said.image, name, beside)
    shades = np.arange(image.white + 1) / image.white
    probability = shades if said.negate else 1.0 - shades
    occupied: NDArray[np.bool_] = (probability > said.occupied_thresh)[image.pixels]
    if not occupied.any():
        raise ShapeError(
            f"'{name}' has no occupied cell: no pixel of '{said.image}' is dark enough for 'occupied_thresh'"
        )
    # Row 0 of an image is at the top.
    boxes = rectangles(occupied[::-1], MAX_WALLS)
    if boxes is None:
        raise ShapeError(
            f"'{name}' needs more than {MAX_WALLS:,} boxes after merging adjacent cells; "
            "remove isolated cells, or use a coarser resolution"
        )
    for cells in boxes:
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
    used_keys = {key: value for key, value in keys.items() if key in MapFile.model_fields}
    try:
        said = MapFile.model_validate(used_keys)
    except ValidationError as error:
        problems = [document.problem(path, message) for path, message in spec_errors(MapFile, used_keys, error)]
        raise ShapeError("; ".join(map(str, problems))) from None
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
    merged: list[Rectangle] = []
    begun: dict[tuple[int, int], int] = {}
    last = -1
    for row, runs in _runs(cells):
        if row != last + 1:
            merged += _closed(begun, {}, last + 1)
        merged += _closed(begun, runs, row)
        for run in runs:
            begun.setdefault(run, row)
        last = row
        if len(merged) + len(begun) > most:
            return None
    return [*merged, *_closed(begun, {}, last + 1)]


def _closed(begun: dict[tuple[int, int], int], runs: dict[tuple[int, int], None], row: int) -> Iterator[Rectangle]:
    ended = [run for run in begun if run not in runs]
    return iter([Rectangle(*run, begun.pop(run), row) for run in ended])


def _runs(cells: NDArray[np.bool_]) -> Iterator[tuple[int, dict[tuple[int, int], None]]]:
    """Yield each row that has set cells, with the start and end of each run."""
    for row in np.flatnonzero(cells.any(axis=1)).tolist():
        padded = np.concatenate(([False], cells[row], [False]))
        edges = np.flatnonzero(padded[1:] != padded[:-1]).tolist()
        yield row, dict.fromkeys(zip(edges[::2], edges[1::2], strict=True))


MAX_SAMPLES: Final = 250_000  # 500 x 500. PyBullet takes 0.5 s to load these, and crashes with a few million.
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
        problem = f"'{name}' has {columns} x {rows} pixels; at most {MAX_SAMPLES:,} samples are simulated"
        raise ShapeError(f"{problem}: scale it down", "image")
    return image.pixels.astype(np.float64) * (height / image.white)
