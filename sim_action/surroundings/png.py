"""Grey PNG images of 8 or 16 bits (PNG Specification, third edition)."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_action.surroundings.images import Grey, ImageError, checked_size

_SIGNATURE_BYTES: Final = 8
_COLOUR_TYPES: Final = {0: "grey", 2: "colour", 3: "a palette", 4: "grey with transparency", 6: "colour"}
_NONE, _SUB, _UP, _AVERAGE, _PAETH = range(5)


def read_png(data: bytes) -> Grey:
    """Reads the bytes of a file. Raises ImageError."""
    chunks = _chunks(data)
    kind, header = next(chunks, (b"", b""))
    if kind != b"IHDR" or len(header) != struct.calcsize(">IIBBBBB"):
        raise ImageError("is no PNG: it does not begin with a header")
    width, height, bits, colour, _, _, interlaced = struct.unpack(">IIBBBBB", header)
    checked_size(width, height)
    if colour != 0 or bits not in (8, 16) or interlaced:
        found = f"{_COLOUR_TYPES.get(colour, 'unknown')}, {bits} bits{', interlaced' if interlaced else ''}"
        raise ImageError(f"is a PNG of another kind ({found}); save it in grey, 8 or 16 bits, not interlaced")
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
    """No more than so many bytes, whatever the file would unpack to."""
    try:
        data = zlib.decompressobj().decompress(packed, size)
    except zlib.error:
        raise ImageError("is damaged: its pixels do not unpack") from None
    if len(data) < size:
        raise ImageError("is damaged: it has fewer pixels than it says")
    return data


def _unfiltered(data: bytes, height: int, stride: int, step: int) -> NDArray[np.uint8]:
    """(H, stride) bytes; a row is told by how it differs from what is left of it and above it."""
    told = np.frombuffer(data, np.uint8).reshape(height, stride + 1)
    rows = np.zeros((height + 1, stride), np.uint8)
    for number, (kind, *_) in enumerate(told[:, :1].tolist(), start=1):
        difference, above = told[number - 1, 1:], rows[number - 1]
        if kind in (_NONE, _UP):
            rows[number] = difference + above if kind == _UP else difference
        elif kind == _SUB:
            for first in range(step):
                rows[number, first::step] = np.cumsum(difference[first::step], dtype=np.uint8)
        elif kind in (_AVERAGE, _PAETH):
            rows[number] = _predicted(kind, difference.tolist(), above.tolist(), step)
        else:
            raise ImageError(f"is damaged: a row of an unknown kind, {kind}")
    return rows[1:]


def _predicted(kind: int, difference: list[int], above: list[int], step: int) -> list[int]:
    row = [0] * step
    over = [0] * step + above
    for at, more in enumerate(difference):
        left, up, corner = row[at], over[at + step], over[at]
        row.append((more + ((left + up) // 2 if kind == _AVERAGE else _paeth(left, up, corner))) & 255)
    return row[step:]


def _paeth(left: int, up: int, corner: int) -> int:
    guess = left + up - corner
    return min((left, up, corner), key=lambda value: abs(guess - value))
