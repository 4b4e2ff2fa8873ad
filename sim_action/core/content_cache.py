"""A cache of derived data that outlives the process, such as hulls of meshes.

An entry is used only if its content is intact and was made from the same source in the same way. Otherwise, and if the
cache cannot be read or written, the data is made again: the cache never changes a result, only the time that it takes.
"""

from __future__ import annotations

import hashlib
import json
import os
from contextlib import suppress
from pathlib import Path
from typing import Final

from sim_action.core.files import read_at_most, whole_file
from sim_action.core.records import dataclass

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
