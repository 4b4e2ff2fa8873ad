"""Files that are written whole or not at all."""

from __future__ import annotations

import secrets
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, Final

# On Windows, a file that somebody is reading cannot be replaced, and nobody of ours reads for so long; in s.
_READING: Final = 2.0
_READING_POLL: Final = 0.01


@contextmanager
def whole_file(path: Path) -> Iterator[BinaryIO]:
    """A file to write to, which takes the place of whatever has that name when all is written. Raises OSError."""
    unfinished = path.with_name(f".{secrets.token_hex(8)}{path.suffix}")
    try:
        with unfinished.open("xb") as file:
            yield file
        _put_in_place(unfinished, path)
    finally:
        unfinished.unlink(missing_ok=True)


def _put_in_place(unfinished: Path, path: Path) -> None:
    patience = time.monotonic() + _READING
    while True:
        try:
            unfinished.replace(path)
        except PermissionError:
            if sys.platform != "win32" or time.monotonic() >= patience:
                raise
            time.sleep(_READING_POLL)
        else:
            return
