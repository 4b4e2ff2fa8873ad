"""Digests of files, for decisions that must notice every change."""

from __future__ import annotations

import hashlib
import os
import stat
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from sim_action.core.files import open_regular

MISSING: Final = "missing"
"""The digest of a file that does not exist."""

_MAX_READ_BYTES: Final = 256 << 20
_PART_BYTES: Final = 1 << 20
# Linux stamps files with a clock that may be one tick late.
CLOCK_TICK_NS: Final = 20_000_000


class FileDigests:
    """The digests of the contents of files, each read once.

    A file that was changed after `began_ns` (as `time.time_ns`) has no digest: its content at that time is not known.
    After 256 MiB of contents, the identity, the size and the time of the last change of a file count as its content.
    """

    def __init__(self, began_ns: int) -> None:
        self._oldest_change_ns = began_ns - CLOCK_TICK_NS
        self._left = _MAX_READ_BYTES
        self._known: dict[Path, str | None] = {}

    def of(self, path: Path) -> str | None:
        """Return the digest of a file or link, with its permission to run; None: it is not known."""
        if path not in self._known:
            self._known[path] = self._digest(path)
        return self._known[path]

    def _digest(self, path: Path) -> str | None:
        try:
            found = path.lstat()
        except (FileNotFoundError, NotADirectoryError):
            return MISSING
        except (OSError, ValueError):
            return None
        return self.of_found(path, found)

    def of_found(self, path: Path, found: os.stat_result, algorithm: str = "sha256") -> str | None:
        """Return the digest of a file or link with this status, with the object name that git gives it; or None.

        `algorithm`: that of git's object names.
        """
        if _changed_ns(found) >= self._oldest_change_ns:
            return None
        try:
            if stat.S_ISLNK(found.st_mode):
                target = os.fsencode(path.readlink())
                return git_content("120000", _named([target], len(target), algorithm), len(target))
            if not stat.S_ISREG(found.st_mode):
                return f"no file {stat.S_IFMT(found.st_mode):o}"
            mode, size = "100755" if found.st_mode & stat.S_IXUSR else "100644", found.st_size
            if size > self._left:
                return f"{mode} {found.st_dev} {found.st_ino} {size} {_changed_ns(found)} {found.st_mtime_ns}"
            self._left -= size
            with open_regular(path, follow_link=False) as file:
                parts = iter(lambda: file.read(_PART_BYTES), b"")
                return git_content(mode, _named(parts, size, algorithm), size)
        except OSError:
            return None


def git_content(mode: str, name: str, size: int) -> str:
    """Return the digest of a file with this mode, object name and size in bytes.

    Filters and line ends may give one object of git different contents, which differ in size.
    """
    return f"{mode} {name} {size}"


def _named(parts: Iterable[bytes], size: int, algorithm: str) -> str:
    """Return the object name that git gives a content."""
    digest = hashlib.new(algorithm, b"blob %d\0" % size, usedforsecurity=False)
    for part in parts:
        digest.update(part)
    return digest.hexdigest()


def _changed_ns(found: os.stat_result) -> int:
    return found.st_mtime_ns if sys.platform == "win32" else found.st_ctime_ns
