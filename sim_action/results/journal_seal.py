"""The seal of the journal: verdicts are taken over only if sim-action wrote them for this user.

A record with a verdict that a later call may take over ends with a keyed digest of its line. The key lies in the user's
cache folder, outside of every checkout, so that files of a stranger carry no valid seal. In addition, neither the
journal nor the key counts if a git repository around it tracks it, or if it is unknown whether one does.
"""

from __future__ import annotations

import hashlib
import os
from contextlib import suppress
from pathlib import Path
from typing import Final, Self

from sim_action.core.files import cache_folder, open_regular, whole_file
from sim_action.core.git_tree import GitError, is_tracked, repositories_around
from sim_action.core.records import dataclass

_KEY_BYTES: Final = 32
_BEGINNING: Final = b',"seal":"'


@dataclass(frozen=True, slots=True)
class Seal:
    """The key of this user, 32 random bytes."""

    key: bytes

    @classmethod
    def of_user(cls) -> Self | None:
        """Return the seal of this user, whose key is made once; None if it cannot be kept."""
        path = key_file()
        # The last: a NUL in the path.
        with suppress(OSError, ValueError):
            key = b"" if path is None or not path.exists() else _read(path)
            if path is not None and len(key) != _KEY_BYTES:
                path.parent.mkdir(parents=True, exist_ok=True)
                with whole_file(path) as file:
                    Path(file.name).chmod(0o600)
                    file.write(os.urandom(_KEY_BYTES))
                key = _read(path)
            return cls(key) if len(key) == _KEY_BYTES else None
        return None

    def on(self, line: bytes) -> bytes:
        """Return a line, a JSON object, with the digest as its last key."""
        body = line.removesuffix(b"}\n")
        digest = hashlib.blake2b(body, key=self.key, digest_size=_KEY_BYTES).hexdigest()
        return b'%s%s%s"}\n' % (body, _BEGINNING, digest.encode())

    def fits(self, line: bytes) -> bool:
        """Return True if a line was written with this key and has not changed since."""
        body, _, _ = line.rpartition(_BEGINNING)
        return self.on(body) == line


def key_file() -> Path | None:
    """Return the path of the key; None without a home folder."""
    folder = cache_folder("resume")
    return None if folder is None else folder / "key"


def _read(path: Path) -> bytes:
    with open_regular(path, follow_link=False) as file:
        return file.read(_KEY_BYTES + 1)


def distrusted(path: Path) -> str | None:
    """Return why a stranger may have brought a file, or its link's target, to continue its name; else None."""
    around = repositories_around(path)
    try:
        tracking = [root for root in around if is_tracked(root, path)]
    except GitError as error:
        return f"may belong to the checkout: {error}"
    if tracking:
        return f"belongs to the git repository {tracking[0]}, and everyone who changes the repository can write it"
    bounds = [Path.cwd(), *map(Path, filter(None, [os.environ.get("GITHUB_WORKSPACE")]))]
    real = Path(os.path.realpath(path))
    if not around and (inside := [bound for bound in bounds if real.is_relative_to(os.path.realpath(bound))]):
        return f"may belong to the checkout: it is in {inside[0]}, without a git repository that names its own files"
    return None
