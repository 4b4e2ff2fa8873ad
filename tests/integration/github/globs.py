"""Which files the path inputs of actions mean: one path or glob a line, and `!` takes out again."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from glob import glob
from pathlib import Path
from typing import Final

from tests.integration.github.errors import UnsupportedFeature

_WILDCARD: Final = re.compile(r"[*?\[]")
# Some of the actions know them, and some do not.
_BRACES: Final = re.compile(r"[{}]|[!+@?]\(")


@dataclass(frozen=True, slots=True)
class Found:
    """What patterns have found.

    Attributes:
        roots: for each pattern, the folder or file that is named before its first wildcard.
    """

    files: tuple[Path, ...]
    roots: tuple[Path, ...]


def lines(text: str) -> list[str]:
    """The lines of an input that say something."""
    return [line.strip() for line in text.splitlines() if line.strip() and not line.strip().startswith("#")]


def find(patterns: Iterable[str], workspace: Path, *, descend: bool) -> Found:
    """The files that patterns mean; with descend, a folder means all that is in it."""
    files: set[Path] = set()
    roots: list[Path] = []
    for pattern in patterns:
        if _BRACES.search(pattern.removeprefix("!")):
            raise UnsupportedFeature(f"pattern {pattern!r}")
        if pattern.startswith("!"):
            files -= _matches(pattern[1:], workspace, descend=descend)
        else:
            files |= _matches(pattern, workspace, descend=descend)
            roots.append(_root(pattern, workspace))
    return Found(tuple(sorted(files)), tuple(roots))


def _matches(pattern: str, workspace: Path, *, descend: bool) -> set[Path]:
    # The pattern may be absolute, which Path.glob refuses.
    names = glob(pattern, root_dir=workspace, recursive=True, include_hidden=True)  # noqa: PTH207
    matches = {workspace / name for name in names}
    if descend:
        matches |= {below for match in matches if match.is_dir() for below in match.rglob("*")}
    return {match for match in matches if match.is_file()}


def _root(pattern: str, workspace: Path) -> Path:
    parts = Path(pattern).parts
    literal = next((number for number, part in enumerate(parts) if _WILDCARD.search(part)), len(parts))
    return workspace.joinpath(*parts[:literal])
