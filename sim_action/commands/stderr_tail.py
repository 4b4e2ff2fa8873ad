"""What a program writes on its standard error: passed on as it comes, and its end kept."""

from __future__ import annotations

import os
import threading
from contextlib import suppress
from typing import IO, Final

_MOST_BYTES: Final = 2_000
_MOST_LINES: Final = 20
# The last of it may still be on its way when the program is gone, and what that started may hold the pipe, in s.
_PATIENCE: Final = 1.0


class LastWords:
    """Reads a pipe in a thread of its own until it ends; of what comes, so many bytes are kept at the most."""

    def __init__(self, pipe: IO[bytes], passed_on_to: int, most: int = _MOST_BYTES) -> None:
        self._pipe, self._most = pipe, most
        self._target = passed_on_to
        self._end = b""
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def text(self, *, is_over: bool) -> str:
        """The last lines that were written; all of them, if the program is gone."""
        if is_over:
            self._thread.join(_PATIENCE)
        return "\n".join(self.all().strip().splitlines()[-_MOST_LINES:])

    def all(self) -> str:
        """All that is kept."""
        return self._end.decode("utf-8", errors="replace")

    def close(self) -> None:
        """Waits until all is passed on, for a moment."""
        self._thread.join(_PATIENCE)

    def _listen(self) -> None:
        with self._pipe as pipe:
            while said := os.read(pipe.fileno(), 65536):
                self._end = (self._end + said)[-self._most :]
                # It must be able to go on, whatever became of the place where its words are kept.
                with suppress(OSError):
                    _write_all(self._target, said)


def _write_all(descriptor: int, data: bytes) -> None:
    while data:
        data = data[os.write(descriptor, data) :]
