"""CDR, as ROS 2 encodes messages: little-endian, each number at a multiple of its size.

Messages that differ in numbers alone are encoded together, into the same form.
"""

from __future__ import annotations

from typing import Final, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Of the plain encoding, little-endian (OMG's DDSI-RTPS 10.2); what follows it is aligned as if it began there.
_HEADER: Final = b"\x00\x01\x00\x00"


class CdrForm:
    """A message, field by field, with gaps for the numbers in which one differs from the next."""

    def __init__(self) -> None:
        self._text = bytearray()
        self._gaps: list[tuple[int, np.dtype[np.generic], int]] = []

    def string(self, text: str) -> Self:
        """The same text in every message."""
        encoded = text.encode(errors="replace").replace(b"\0", b"") + b"\0"
        self.fixed("<u4", len(encoded))
        self._text += encoded
        return self

    def strings(self, *texts: str) -> Self:
        """A sequence of them."""
        self.fixed("<u4", len(texts))
        for text in texts:
            self.string(text)
        return self

    def fixed(self, kind: str, *numbers: float) -> Self:
        """The same numbers in every message; `kind`: as numpy has it, such as "<f8"."""
        self._align(np.dtype(kind).itemsize)
        self._text += np.array(numbers, dtype=kind).tobytes()
        return self

    def gap(self, kind: str, count: int = 1) -> Self:
        """Numbers of which each message has its own."""
        dtype: np.dtype[np.generic] = np.dtype(kind)
        if count:
            self._align(dtype.itemsize)
            self._gaps.append((len(self._text), dtype, count))
            self._text += bytes(dtype.itemsize * count)
        return self

    def filled(self, messages: int, *columns: ArrayLike) -> list[bytes]:
        """The messages; `columns`: for each gap of n numbers (N, n), or (N,) for a single one."""
        table = np.tile(np.frombuffer(_HEADER + bytes(self._text), dtype=np.uint8), (messages, 1))
        for (offset, dtype, count), column in zip(self._gaps, columns, strict=True):
            numbers = np.ascontiguousarray(np.asarray(column).reshape(messages, count).astype(dtype))
            first = len(_HEADER) + offset
            table[:, first : first + dtype.itemsize * count] = numbers.view(np.uint8).reshape(messages, -1)
        return _rows(table)

    def _align(self, size: int) -> None:
        self._text += bytes(-len(self._text) % size)


def _rows(table: NDArray[np.uint8]) -> list[bytes]:
    whole, size = table.tobytes(), table.shape[1]
    return [whole[start : start + size] for start in range(0, len(whole), size)]
