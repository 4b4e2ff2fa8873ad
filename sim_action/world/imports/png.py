"""Grey PNG images of 8 or 16 bits (PNG Specification, third edition)."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_action.world.imports.images import Grey, ImageError, checked_size

_SIGNATURE_BYTES: Final = 8
_COLOUR_TYPES: Final = {0: "grey", 2: "colour", 3: "a palette", 4: "grey with transparency", 6: "colour"}
_LAST_KIND: Final = 4

Bytes = NDArray[np.int16]


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
    """(H, stride) bytes; each is told by how it differs from what is left of it, above it, and in the corner between.

    These three are known of a whole diagonal, from the lower left to the upper right, once the two before it are.
    """
    told = np.frombuffer(data, np.uint8).reshape(height, stride + 1)
    kinds = told[:, :1]
    if kinds.max() > _LAST_KIND:
        raise ImageError(f"is damaged: a row of an unknown kind, {kinds.max()}")
    columns = stride // step
    framed = np.zeros((height + 1, columns + 1, step), np.int16)
    framed[1:, 1:] = told[:, 1:].reshape(height, columns, step)
    flat = framed.reshape(-1, step)
    for diagonal in range(height + columns - 1):
        top, bottom = max(0, diagonal - columns + 1), min(height - 1, diagonal)
        count, start = bottom - top + 1, (top + 1) * (columns + 1) + diagonal - top + 1
        here, left, up, corner = (
            flat[at : at + (count - 1) * columns + 1 : columns]
            for at in (start, start - 1, start - columns - 1, start - columns - 2)
        )
        here += _predicted(kinds[top : bottom + 1], left, up, corner)
        here &= 255
    return framed[1:, 1:].reshape(height, stride).astype(np.uint8)


def _predicted(kinds: NDArray[np.uint8], left: Bytes, up: Bytes, corner: Bytes) -> Bytes:
    """(N, step), of N bytes or pairs of them in rows of these kinds: nothing, left, up, average, Paeth."""
    to_left, to_up, to_corner = abs(up - corner), abs(left - corner), abs(left + up - 2 * corner)
    nearest = np.where(to_up <= to_corner, up, corner)
    paeth = np.where((to_left <= to_up) & (to_left <= to_corner), left, nearest)
    found: Bytes = np.choose(kinds, np.stack((np.zeros_like(left), left, up, (left + up) // 2, paeth)))
    return found
