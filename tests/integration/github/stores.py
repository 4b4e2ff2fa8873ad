"""What outlives a job: the caches of a repository, and the artifacts of one workflow run."""

from __future__ import annotations

import hashlib
import re
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from tests.integration.github.errors import StepFailed

_FORBIDDEN_IN_NAMES: Final = re.compile(r'[":<>|*?\r\n\\/]')
_FORBIDDEN_IN_PATHS: Final = re.compile(r'[":<>|*?\r\n]')


@dataclass(frozen=True, slots=True)
class CacheStore:
    """Caches, by their key and by the path that was saved: what is asked for with another path is not found."""

    folder: Path

    def keys(self) -> list[str]:
        """The keys of all caches, the newest last."""
        entries = sorted(self.folder.glob("*/key"), key=lambda entry: entry.stat().st_mtime_ns)
        return [entry.read_text(encoding="utf-8") for entry in entries]

    def matching(self, key: str, prefix: str, path: str) -> str | None:
        """The key of the cache that is found for a key, or else by it as a prefix, or else by another one."""
        there = [kept for kept in reversed(self.keys()) if self._entry(kept, path).is_dir()]
        if key in there:
            return key
        prefixes = (key, prefix) if prefix else (key,)
        return next((kept for start in prefixes for kept in there if kept.startswith(start)), None)

    def save(self, key: str, path: str, content: Path) -> bool:
        """Keeps a copy under a key and the path that it is asked for by; an existing cache is left alone."""
        entry = self._entry(key, path)
        if entry.exists():
            return False
        copy(content, entry / "content")
        (entry / "key").write_text(key, encoding="utf-8")
        return True

    def restore(self, key: str, path: str, target: Path) -> None:
        """Puts the copy where it is to be."""
        copy(self._entry(key, path) / "content", target)

    def _entry(self, key: str, path: str) -> Path:
        return self.folder / hashlib.sha256(f"{key}\0{path}".encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class ArtifactStore:
    """The artifacts of one workflow run, each in a folder of its name."""

    folder: Path

    def names(self) -> list[str]:
        """The names of all artifacts."""
        return sorted(entry.name for entry in self.folder.iterdir()) if self.folder.exists() else []

    def upload(self, name: str, files: Mapping[str, Path]) -> None:
        """Keeps copies of files by their paths in the artifact. Raises StepFailed."""
        if not name or name in {".", ".."} or _FORBIDDEN_IN_NAMES.search(name):
            raise StepFailed(f"The artifact name is not valid: {name}")
        if path := next((path for path in files if _FORBIDDEN_IN_PATHS.search(path)), None):
            raise StepFailed(f"The path for one of the files in artifact is not valid: {path}")
        if name in self.names():
            raise StepFailed(f"(409) Conflict: an artifact with this name already exists on the workflow run: {name}")
        for path, file in files.items():
            target = self.folder / name / path
            target.parent.mkdir(parents=True, exist_ok=True)
            # As in the archive, nothing but the content is kept.
            shutil.copyfile(file, target)

    def download(self, name: str, folder: Path) -> None:
        """Puts the files of an artifact into a folder."""
        copy(self.folder / name, folder)


def copy(source: Path, target: Path) -> None:
    """Copies a file or folder with its links and times; what is there already is overwritten."""
    target.parent.mkdir(parents=True, exist_ok=True)
    if source.is_dir():
        shutil.copytree(source, target, symlinks=True, dirs_exist_ok=True)
    else:
        shutil.copy2(source, target)
