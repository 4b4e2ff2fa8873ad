"""Discovery of scenario files: from typed names, folders and globs to files."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from fnmatch import fnmatchcase
from pathlib import Path, PurePath
from typing import Final

from sim_action.core.files import open_regular
from sim_action.core.workspace import PathError, Workspace

SUFFIXES: Final = (".sim.yml", ".sim.yaml")
_MAX_LOOKED_AT_BYTES: Final = 65_536
_KEYS: Final = (re.compile(rb"^robot[ \t]*:", re.MULTILINE), re.compile(rb"^[ \t-]*expect[ \t]*:", re.MULTILINE))
_EXTENDS: Final = re.compile(rb"^[ \t-]*extends[ \t]*:[ \t]*[\"']?([^\"'#\r\n]*[^\"'#\s])", re.MULTILINE)
_NEVER_ENTERED: Final = frozenset({"node_modules", "__pycache__", "site-packages"})


def discover(patterns: Iterable[str], *, outside: bool = False) -> dict[str, list[Path]]:
    """Return the scenario files behind each pattern, sorted.

    A folder stands for all `*.sim.yml` and `*.sim.yaml` in it and below, without hidden folders. A name without
    wildcards is a file even if it does not exist: a missing file is reported like other problems of a scenario.
    A link out of the workspace is not entered, unless `outside` is set: the link stands for itself, and is refused when
    it is read.
    """
    return {pattern: list(_matches(pattern, outside)) for pattern in patterns}


def unique(found: Mapping[str, Iterable[Path]]) -> list[Path]:
    """Return each file once, under the name that the first matching pattern gives it."""
    first: dict[str, Path] = {}
    for files in found.values():
        for path in files:
            first.setdefault(compared_name(str(path)), path)
    return list(first.values())


def file_name(path: PurePath) -> str:
    """Return the name that reports show for a file, the same on every system; bytes that are not UTF-8 are escaped."""
    return os.fsencode(path.as_posix()).decode("utf-8", errors="backslashreplace")


def name_beside(file: str, reference: str, path: Path) -> str:
    """Return the name of a file in messages, in the style of the file that refers to its real `path`."""
    as_written = Path(file).parent / reference
    plain = Path(os.path.normpath(as_written))
    return file_name(plain if plain.resolve() == path else as_written)


def compared_name(name: str) -> str:
    """Return one spelling for all names of a file, which need not exist: its real, absolute path."""
    try:
        return os.path.realpath(name)
    except ValueError:  # a NUL or invalid text, which no file name contains
        return name


def paths_of(pattern: str) -> list[Path]:
    """Return the path with exactly this name or, for a pattern with wildcards and no such file, all matches, sorted."""
    # A file whose name has brackets in it is that file.
    if not glob.has_magic(pattern) or os.path.lexists(pattern):
        return [Path(pattern)]
    # As in a shell, `**` inside a longer name is `*`.
    whole = PurePath(pattern)
    parts = [part if part == "**" else part.replace("**", "*") for part in whole.relative_to(whole.anchor).parts]
    # Unlike glob.glob, this follows no link to a folder for `**`: links may form cycles.
    found = Path(whole.anchor).glob(str(PurePath(*parts)))
    return sorted(path for path in found if _is_shown(path, parts))


def _is_shown(path: Path, parts: Iterable[str]) -> bool:
    asked = [part for part in parts if part.startswith(".")]
    return all(not part.startswith(".") or any(fnmatchcase(part, hidden) for hidden in asked) for part in path.parts)


def _matches(pattern: str, outside: bool) -> Iterator[Path]:
    for path in paths_of(pattern):
        if os.path.isdir(path):  # noqa: PTH112 - a name that is too long is no folder
            yield from _below(path) if outside or _stays_inside(path) else (path,)
        elif path == Path(pattern) or _NEVER_ENTERED.isdisjoint(path.parts):
            yield path


def _stays_inside(folder: Path) -> bool:
    """Return False for a folder behind a link out of the workspace."""
    try:
        Workspace.around(folder / "a scenario")
    except (PathError, OSError, RuntimeError):
        return False
    return True


def _below(folder: Path, suffixes: tuple[str, ...] = SUFFIXES) -> Iterator[Path]:
    for parent, folders, files in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith(".") and name not in _NEVER_ENTERED)
        yield from (Path(parent, name) for name in sorted(files) if name.endswith(suffixes))


def misnamed(patterns: Iterable[str], *, outside: bool = False) -> list[Path]:
    """Return the files below folders that look like scenarios, but whose names do not end as those of scenarios.

    They have the keys `robot` and `expect`. Bases are not among them: `*.base.yml`, and what another one extends.
    `outside`: True if folders behind links out of the workspace count.
    """
    texts: dict[str, bytes] = {}
    paths = [path for pattern in patterns for path in paths_of(pattern)]
    for folder in filter(os.path.isdir, paths):  # a name that is too long is no folder
        for path in _below(folder, (".yml", ".yaml")) if outside or _stays_inside(folder) else ():
            if (text := _beginning(path)) is not None:
                texts[str(path)] = text
    extended = {
        compared_name(os.path.join(os.path.dirname(name), os.fsdecode(base)))  # noqa: PTH118, PTH120 - names of any kind
        for name, text in texts.items()
        for base in _EXTENDS.findall(text)
    }
    return [
        Path(name)
        for name, text in texts.items()
        if not name.endswith((*SUFFIXES, ".base.yml", ".base.yaml"))
        and all(key.search(text) for key in _KEYS)
        and compared_name(name) not in extended
    ]


def _beginning(path: Path) -> bytes | None:
    """Return the beginning of a regular file; None if it cannot be read."""
    try:
        with open_regular(path, follow_link=False) as file:
            return file.read(_MAX_LOOKED_AT_BYTES)
    except OSError:
        return None
