"""Files that a stranger may have made: opened only if they are files, since a pipe would hold us up."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO


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
        raise OSError(errno.EINVAL, "it is a folder" if stat.S_ISDIR(mode) else "it is no regular file", str(path))
    return os.fdopen(descriptor, "rb")
