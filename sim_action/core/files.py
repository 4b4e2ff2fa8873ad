"""Safe file access: read regular files only, up to a size; write a file completely or not at all."""

from __future__ import annotations

import errno
import os
import secrets
import stat
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, Final


def read_at_most(path: Path, most: int) -> bytes | None:
    """What is in a file, also behind a link; None: more than so many bytes. Raises OSError as `open_regular` does."""
    with open_regular(path, follow_link=True) as file:
        data = file.read(most + 1)
    return data if len(data) <= most else None


def open_regular(path: Path, *, follow_link: bool) -> BinaryIO:
    """Opens a file to read from; raises OSError, also for what is no file, or a link that is not to be followed."""
    # Windows knows the first of these alone.
    flags = getattr(os, "O_BINARY", 0) | getattr(os, "O_NONBLOCK", 0)
    descriptor = os.open(path, os.O_RDONLY | flags | (0 if follow_link else getattr(os, "O_NOFOLLOW", 0)))
    mode = os.fstat(descriptor).st_mode
    if not stat.S_ISREG(mode):
        os.close(descriptor)
        raise OSError(errno.EINVAL, "it is a folder" if stat.S_ISDIR(mode) else "it is not a regular file", str(path))
    return os.fdopen(descriptor, "rb")


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
