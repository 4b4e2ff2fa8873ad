"""Parts of a report that wait, packed, until its beginning is known: they have megabytes for 10,000 runs."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from typing import Final

_PART_BYTES: Final = 500_000
# A higher level takes several times as long and saves little.
_LEVEL: Final = 1


class PackedParts:
    """A text in UTF-8 that grows at its end and is read from its beginning."""

    def __init__(self) -> None:
        """Begin an empty text."""
        self._packed: list[bytes] = []
        self._last: list[bytes] = []
        self._bytes = 0

    def add(self, part: bytes) -> None:
        """Add text at the end."""
        self._last.append(part)
        self._bytes += len(part)
        if self._bytes >= _PART_BYTES:
            self._packed.append(zlib.compress(b"".join(self._last), _LEVEL))
            self._last, self._bytes = [], 0

    def __iter__(self) -> Iterator[bytes]:
        """Yield the text in parts."""
        for packed in self._packed:
            yield zlib.decompress(packed)
        yield from self._last
