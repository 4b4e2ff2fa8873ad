"""From what people type to scenario files: files, folders, globs."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable, Iterator
from pathlib import Path, PurePosixPath
from typing import Final

SUFFIX: Final = ".sim.yml"

_NEVER_ENTERED: Final = frozenset({"node_modules", "__pycache__", "site-packages"})


def discover(patterns: Iterable[str]) -> dict[str, list[Path]]:
    """The scenario files behind each pattern, sorted.

    A folder means the `*.sim.yml` in it and below, hidden folders left out. A name without wildcards is taken as a
    file even if it does not exist, so that its absence is reported like any other fault of a scenario.
    """
    return {pattern: list(_matches(pattern)) for pattern in patterns}


def unique(found: dict[str, list[Path]]) -> list[Path]:
    """Each file once, as the first pattern that finds it names it."""
    first: dict[Path, Path] = {}
    for files in found.values():
        for path in files:
            first.setdefault(path.resolve(), path)
    return list(first.values())


def file_name(path: Path) -> str:
    """How reports call a file; bytes of its name that are no UTF-8 are written out."""
    return os.fsencode(path).decode("utf-8", errors="backslashreplace")


def compared_name(name: str) -> str:
    """The name of a file as reports have it, written in one way: `a`, `./a` and `.//a` are the same."""
    return str(PurePosixPath(name.replace(os.sep, "/")))


def paths_of(pattern: str) -> list[Path]:
    """What has that very name; for a name with wildcards that is none, what matches it, sorted."""
    # A file whose name has brackets in it is that file.
    if not glob.has_magic(pattern) or os.path.lexists(pattern):
        return [Path(pattern)]
    # Path.glob takes no absolute pattern.
    return sorted(map(Path, glob.glob(pattern, recursive=True)))  # noqa: PTH207


def _matches(pattern: str) -> Iterator[Path]:
    for path in paths_of(pattern):
        if path.is_dir():
            yield from _below(path)
        elif path == Path(pattern) or _NEVER_ENTERED.isdisjoint(path.parts):
            yield path


def _below(folder: Path) -> Iterator[Path]:
    for parent, folders, files in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith(".") and name not in _NEVER_ENTERED)
        yield from (Path(parent, name) for name in sorted(files) if name.endswith(SUFFIX))
