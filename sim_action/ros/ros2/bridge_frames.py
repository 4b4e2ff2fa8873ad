"""The frames of JSON and of arrays on the socket of the bridge. Both of its ends import this, each on its own Python.

A frame has the length of a JSON text, the text, the length of a blob, and the blob. An array of numbers is a part of
the blob, and `{"$array": "f", "at": 0, "count": 360}` in the text.
"""

from __future__ import annotations

import json
import socket
import struct
from array import array
from typing import Any

_LENGTH = struct.Struct("!I")


class Frames:
    """One end of the socket."""

    def __init__(self, end: socket.socket) -> None:
        self.socket = end

    def send(self, content: Any, blob: bytes = b"") -> None:
        """Send a frame. Raises OSError."""
        text = json.dumps(content).encode()
        self.socket.sendall(_LENGTH.pack(len(text)) + text + _LENGTH.pack(len(blob)) + blob)

    def receive(self) -> tuple[Any, memoryview]:
        """Return the content and the blob of the next frame. Raises EOFError if the other end is closed."""
        text = self._part()
        return json.loads(text), memoryview(self._part())

    def _part(self) -> bytes:
        (length,) = _LENGTH.unpack(self._exactly(_LENGTH.size))
        return self._exactly(length)

    def _exactly(self, count: int) -> bytes:
        parts, left = [], count
        while left:
            try:
                part = self.socket.recv(left)
            except ConnectionError:
                part = b""
            if not part:
                raise EOFError
            parts.append(part)
            left -= len(part)
        return b"".join(parts)


def part_of(blob: bytearray, code: str, count: int, content: bytes) -> dict[str, Any]:
    """Add numbers to a blob, and return their description; `code`: their type, as `array` has it."""
    at = len(blob)
    blob += content
    return {"$array": code, "at": at, "count": count}


def array_in(value: Any, blob: memoryview) -> Any:
    """Return a value with the numbers of a part of the blob in place of their description."""
    if isinstance(value, dict) and "$array" in value:
        numbers = array(value["$array"])
        numbers.frombytes(blob[value["at"] : value["at"] + value["count"] * numbers.itemsize])
        return numbers
    return value
