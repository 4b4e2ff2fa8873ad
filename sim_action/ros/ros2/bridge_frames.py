"""The frames of JSON and of arrays on the socket of the bridge. Both of its ends import this, each on its own Python.

A frame has the length of a JSON text, the text, the length of a blob, and the blob. An array of numbers is a part of
the blob, and `{"$array": "f", "at": 0, "count": 360}` in the text.
"""

from __future__ import annotations

import json
import socket
import struct
from array import array
from collections.abc import Callable
from typing import Any

_LENGTH = struct.Struct("!I")


class Frames:
    """One end of the socket; `plain`: returns the plain data of an object that is none."""

    def __init__(self, end: socket.socket, plain: Callable[[Any], Any] = list) -> None:
        self.socket, self._plain = end, plain

    def send(self, content: Any) -> int:
        """Send a frame, and return the bytes of its arrays. Raises OSError."""
        blob = bytearray()

        def packed(value: Any) -> Any:
            if not isinstance(value, array):
                return self._plain(value)
            blob.extend(value.tobytes())
            return {"$array": value.typecode, "at": len(blob) - len(value) * value.itemsize, "count": len(value)}

        text = json.dumps(content, default=packed).encode()
        self.socket.sendall(_LENGTH.pack(len(text)) + text + _LENGTH.pack(len(blob)) + blob)
        return len(blob)

    def receive(self) -> Any:
        """Return the content of the next frame. Raises EOFError if the other end is closed."""
        text = self._part()
        blob = memoryview(self._part())

        def unpacked(value: dict[str, Any]) -> Any:
            if "$array" not in value:
                return value
            numbers = array(value["$array"])
            numbers.frombytes(blob[value["at"] : value["at"] + value["count"] * numbers.itemsize])
            return numbers

        return json.loads(text, object_hook=unpacked)

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
