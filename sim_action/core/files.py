"""Safe file access: read regular files only, up to a size; write or append completely or not at all.

A cache holds derived data that outlives the process, such as hulls of meshes. An entry is used only if its content is
intact and was made from the same source in the same way. Otherwise, and if the cache cannot be read or written, the
data is made again: the cache never changes a result, only the time that it takes.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import stat
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, Final

from sim_action.core.records import dataclass
from sim_action.core.wording import nearest, shown

_ENDING: Final = re.compile(r"(\.sim)?\.ya?ml$")


def read_at_most(path: Path, most: int) -> bytes | None:
    """Return the content of a file, or None if it has more than `most` bytes; links are followed. Raise OSError."""
    with open_regular(path, follow_link=True) as file:
        data = file.read(most + 1)
    return data if len(data) <= most else None


def content_or_empty(path: Path, most: int) -> bytes:
    """Return the content of a file; nothing if it cannot be read, or has more than `most` bytes."""
    with suppress(OSError):
        return read_at_most(path, most) or b""
    return b""


def open_regular(path: Path, *, follow_link: bool) -> BinaryIO:
    """Open a regular file for reading; raise OSError for anything else, and for a link if links are not followed."""
    # Windows has only the first of these flags.
    flags = getattr(os, "O_BINARY", 0) | getattr(os, "O_NONBLOCK", 0)
    no_follow = 0 if follow_link else getattr(os, "O_NOFOLLOW", 0)
    if not follow_link and not no_follow and path.is_symlink():
        raise OSError(errno.ELOOP, "it is a link", str(path))
    descriptor = os.open(path, os.O_RDONLY | flags | no_follow)
    mode = os.fstat(descriptor).st_mode
    if not stat.S_ISREG(mode):
        os.close(descriptor)
        raise OSError(errno.EINVAL, "it is a folder" if stat.S_ISDIR(mode) else "it is not a regular file", str(path))
    return os.fdopen(descriptor, "rb")


UNFINISHED_FILE: Final = re.compile(r"\.[0-9a-f]{16}(\.[a-z0-9]+)?")
"""The names of temporary files of `whole_file`. A killed process leaves them."""

# On Windows, a file that is open for reading cannot be replaced; sim-action itself never reads for so long.
_REPLACE_TIMEOUT_S: Final = 2.0
_REPLACE_POLL_S: Final = 0.01


@contextmanager
def whole_file(path: Path) -> Iterator[BinaryIO]:
    """Open a temporary file that replaces `path` after everything is written. Raise OSError."""
    unfinished = path.with_name(f".{os.urandom(8).hex()}{path.suffix}")
    try:
        with unfinished.open("xb") as file:
            yield file
        _put_in_place(unfinished, path)
    except BaseException:
        unfinished.unlink(missing_ok=True)
        raise


def _put_in_place(unfinished: Path, path: Path) -> None:
    patience = time.monotonic() + _REPLACE_TIMEOUT_S
    while True:
        try:
            unfinished.replace(path)
        except PermissionError:
            if sys.platform != "win32" or time.monotonic() >= patience:
                raise
            time.sleep(_REPLACE_POLL_S)
        else:
            return


def append_whole(path: Path, data: bytes) -> None:
    """Append to a file, or make it; after an error it has its former size. Raise OSError, also for a pipe."""
    flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | getattr(os, "O_BINARY", 0) | getattr(os, "O_NONBLOCK", 0)
    with os.fdopen(os.open(path, flags, 0o666), "ab", buffering=0) as file:
        if sys.platform != "win32":
            os.set_blocking(file.fileno(), True)
        status = os.fstat(file.fileno())
        rest = memoryview(data)
        try:
            while rest:
                rest = rest[os.write(file.fileno(), rest) :]
        except OSError:
            if stat.S_ISREG(status.st_mode):
                with suppress(OSError):
                    file.truncate(status.st_size)
            raise


def write_all(descriptor: int, data: bytes) -> None:
    """Write all bytes to a descriptor. Raise OSError."""
    while data:
        data = data[os.write(descriptor, data) :]


def similar_path(path: Path, endings: tuple[str, ...] = ()) -> str:
    """Return a hint at a folder, or a file with one of `endings`, similar to the first missing part of `path`."""
    missing = path
    while missing.parent != missing and not os.path.exists(missing.parent):  # noqa: PTH110 - a folder that may not be entered counts as missing
        missing = missing.parent
    file_endings = endings if missing == path else ()
    try:
        with os.scandir(missing.parent) as entries:
            names = sorted(entry.name for entry in entries if entry.is_dir() or entry.name.endswith(file_endings))
    except OSError:
        return ""
    # With their endings, all names would be similar.
    by_stem = {_ENDING.sub("", name): name for name in names if not name.startswith(".")}
    near = nearest(_ENDING.sub("", missing.name), by_stem)
    return "" if near is None else f"; did you mean {shown((missing.parent / by_stem[near]).as_posix())}?"


MAX_ENTRY_BYTES: Final = 100_000_000  # Limit of an entry. Larger data is made each time.
_MARK: Final = b"# sim-action cache entry 1"


def cache_folder(name: str) -> Path | None:
    """Return the cache folder of this user by the XDG specification, from absolute paths only; None without a home."""
    stated = os.environ.get("XDG_CACHE_HOME", "")
    if os.path.isabs(stated):  # noqa: PTH117 - a text with a NUL is no Path
        return Path(stated, "sim-action", name)
    try:
        return Path.home() / ".cache" / "sim-action" / name
    except RuntimeError:
        return None


@dataclass(frozen=True, slots=True)
class Entry:
    """The place in the cache for the data that is made from a source."""

    path: Path | None  # of its file; None: there is no cache
    key: str  # the digest of the source and of the way in which the data is made

    @classmethod
    def of(cls, folder: Path | None, suffix: str, source: bytes, *made_with: object) -> Entry:
        """Return the entry for a source.

        Args:
            folder: of the cache; None: there is no cache.
            suffix: of the file name.
            source: the content of the source.
            made_with: all else that the data depends on, as JSON values: options, limits, the version of the code.
        """
        digest = hashlib.sha256(json.dumps(made_with).encode())
        digest.update(source)
        key = digest.hexdigest()
        return cls(None if folder is None else folder / f"{key}.{suffix}", key)

    def read(self) -> bytes | None:
        """Return the data, exactly as it was written; None if there is no intact entry of this key."""
        if self.path is None:
            return None
        try:
            stored = read_at_most(self.path, MAX_ENTRY_BYTES)
        except (OSError, ValueError):  # a NUL in the path
            return None
        if stored is None:
            return None
        head, _, content = stored.partition(b"\n")
        return content if head == self._head(content) else None

    def write(self, content: bytes) -> None:
        """Store the data; parallel writers do not disturb each other. Without success, there is no entry."""
        head = self._head(content)
        if self.path is None or len(head) + 1 + len(content) > MAX_ENTRY_BYTES:
            return
        with suppress(OSError, ValueError):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(self.path) as file:
                file.write(head + b"\n" + content)

    def _head(self, content: bytes) -> bytes:
        return b"%s %s %s" % (_MARK, self.key.encode(), hashlib.sha256(content).hexdigest().encode())
