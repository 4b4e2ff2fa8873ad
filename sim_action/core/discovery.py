"""From what people type to scenario files: files, folders, globs."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable, Iterator, Mapping
from fnmatch import fnmatchcase
from pathlib import Path, PurePath
from typing import Final

SUFFIXES: Final = (".sim.yml", ".sim.yaml")

_NEVER_ENTERED: Final = frozenset({"node_modules", "__pycache__", "site-packages"})


def discover(patterns: Iterable[str]) -> dict[str, list[Path]]:
    """The scenario files behind each pattern, sorted.

    A folder means the `*.sim.yml` and `*.sim.yaml` in it and below, hidden folders left out. A name without wildcards
    is taken as a file even if it does not exist, so that its absence is reported like any other fault of a scenario.
    """
    return {pattern: list(_matches(pattern)) for pattern in patterns}


def unique(found: Mapping[str, Iterable[Path]]) -> list[Path]:
    """Each file once, as the first pattern that finds it names it."""
    first: dict[str, Path] = {}
    for files in found.values():
        for path in files:
            first.setdefault(compared_name(str(path)), path)
    return list(first.values())


def file_name(path: PurePath) -> str:
    """How reports call a file, on every system; bytes of its name that are no UTF-8 are written out."""
    return os.fsencode(path.as_posix()).decode("utf-8", errors="backslashreplace")


def compared_name(name: str) -> str:
    """A name of a file in one way for all spellings: where it is, as seen from the current folder.

    It need not be there; links that are there are followed.
    """
    try:
        return os.path.realpath(name)
    except ValueError:  # a NUL, or what is no text: no file is called so
        return name


def paths_of(pattern: str) -> list[Path]:
    """What has that very name; for a name with wildcards that is none, what matches it, sorted."""
    # A file whose name has brackets in it is that file.
    if not glob.has_magic(pattern) or os.path.lexists(pattern):
        return [Path(pattern)]
    # As in a shell, `**` beside something else is `*`.
    whole = PurePath(pattern)
    parts = [part if part == "**" else part.replace("**", "*") for part in whole.relative_to(whole.anchor).parts]
    # Unlike glob.glob, this goes through no link to a folder for `**`: links may lead in circles.
    found = Path(whole.anchor).glob(str(PurePath(*parts)))
    return sorted(path for path in found if _is_shown(path, parts))


def _is_shown(path: Path, parts: Iterable[str]) -> bool:
    """Hidden files and folders are found only by patterns that say so."""
    asked = [part for part in parts if part.startswith(".")]
    return all(not part.startswith(".") or any(fnmatchcase(part, hidden) for hidden in asked) for part in path.parts)


def _matches(pattern: str) -> Iterator[Path]:
    for path in paths_of(pattern):
        if path.is_dir():
            yield from _below(path)
        elif path == Path(pattern) or _NEVER_ENTERED.isdisjoint(path.parts):
            yield path


def _below(folder: Path) -> Iterator[Path]:
    for parent, folders, files in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith(".") and name not in _NEVER_ENTERED)
        yield from (Path(parent, name) for name in sorted(files) if name.endswith(SUFFIXES))
