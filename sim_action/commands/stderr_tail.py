"""Forward the standard error of a program, and keep its last lines for messages."""

from __future__ import annotations

import os
import threading
from contextlib import suppress
from typing import IO, Final

_MAX_BYTES: Final = 2_000
_MAX_LINES: Final = 20
# The last output may arrive after the program has ended. A child of the program may keep the pipe open.
_JOIN_WAIT_S: Final = 1.0


class StderrTail:
    """Reads a pipe in a thread until it ends, and keeps at most the last `max_bytes` bytes."""

    def __init__(self, pipe: IO[bytes], forward_to: int, max_bytes: int = _MAX_BYTES) -> None:
        self._pipe, self._max_bytes = pipe, max_bytes
        self._target = forward_to
        self._end = b""
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def text(self, *, is_over: bool) -> str:
        """Return the last lines; `is_over`: the program has ended, so wait for the rest of its output."""
        if is_over:
            self._thread.join(_JOIN_WAIT_S)
        return "\n".join(self.all().strip().splitlines()[-_MAX_LINES:])

    def all(self) -> str:
        """Return all text that is kept."""
        return self._end.decode("utf-8", errors="replace")

    def close(self) -> None:
        """Wait a moment until all output is forwarded."""
        self._thread.join(_JOIN_WAIT_S)

    def _listen(self) -> None:
        with self._pipe as pipe:
            while data := os.read(pipe.fileno(), 65536):
                self._end = (self._end + data)[-self._max_bytes :]
                # The program must not block if our own output is closed.
                with suppress(OSError):
                    _write_all(self._target, data)


def _write_all(descriptor: int, data: bytes) -> None:
    while data:
        data = data[os.write(descriptor, data) :]
