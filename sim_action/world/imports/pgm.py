"""Netpbm's grey images, as bytes (P5) or as text (P2)."""

from __future__ import annotations

import re
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_action.world.imports.images import Grey, ImageError, checked_size

# Width, height and the value of white, with comments between; one space ends the header.
_BLANK: Final = rb"(?:\s|#[^\n]*\n)+"
_NUMBER: Final = rb"(\d{1,9})"
_HEADER: Final = re.compile(rb"(P[25])" + 3 * (_BLANK + _NUMBER) + rb"\s")
_COMMENT: Final = re.compile(rb"#[^\n]*")
_WHITEST: Final = 65_535
_AT_A_TIME: Final = 100_000
_ONE_BYTE: Final = 256


def read_pgm(data: bytes) -> Grey:
    """Reads the bytes of a file. Raises ImageError."""
    header = _HEADER.match(data[:10_000])
    if header is None:
        raise ImageError("is no PGM: its header has no width, height and value of white")
    width, height, white = (int(header[number]) for number in (2, 3, 4))
    checked_size(width, height)
    if not 0 < white <= _WHITEST:
        raise ImageError(f"says that white is {white}; it is 1 to {_WHITEST}")
    is_text = header[1] == b"P2"
    read = _text(data, header.end(), width * height) if is_text else _bytes(data[header.end() :], white, width * height)
    if len(read) < width * height:
        raise ImageError(f"is cut off: {width} x {height} pixels are {width * height:,}, and it has {len(read):,}")
    pixels = np.minimum(read[: width * height], white).astype(np.uint16)
    return Grey(pixels.reshape(height, width), white)


def _bytes(data: bytes, white: int, count: int) -> NDArray[np.uint16]:
    if white < _ONE_BYTE:
        return np.frombuffer(data[:count], np.uint8).astype(np.uint16)
    return np.frombuffer(data[: min(2 * count, len(data) // 2 * 2)], ">u2").astype(np.uint16)


def _text(data: bytes, at: int, count: int) -> NDArray[np.uint16]:
    """Of as many pixels as count, some lines at a time: a word of Python takes 20 times the room that it has here."""
    read = [np.empty(0, np.uint16)]
    while at < len(data) and count > 0:
        end = data.find(b"\n", at + _AT_A_TIME) + 1 or len(data)
        words = _COMMENT.sub(b"", data[at:end]).split(maxsplit=count)[:count]
        read.append(_pixels(words))
        at, count = end, count - len(words)
    return np.concatenate(read)


def _pixels(words: list[bytes]) -> NDArray[np.uint16]:
    try:
        values = np.array(words, dtype=np.int64)
    except (ValueError, OverflowError):
        raise ImageError("has a pixel that is no whole number") from None
    if len(values) and values.min() < 0:
        raise ImageError("has a pixel below 0")
    return np.minimum(values, _WHITEST).astype(np.uint16)
