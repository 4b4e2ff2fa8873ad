"""A Python traceback as tests tell it: what was wrong, and where in the user's own code."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from sim_action.core.discovery import file_name
from sim_action.core.errors import Location

_FRAME: Final = re.compile(r'^ *File "([^"]+)", line ([0-9]{1,9})(?:, in .*)?\n(?: {4,}(\S.*))?', re.MULTILINE)


def location_in(text: str, workspace: Path) -> Location | None:
    """The innermost place that is below the workspace."""
    root = workspace.resolve()
    for file, line, _ in reversed(_FRAME.findall(text)):
        try:
            path = Path(file).resolve()
        except (OSError, ValueError, RuntimeError):  # too long, a NUL in it, links in a circle
            continue
        if path.is_relative_to(root):
            return Location(shown_path(path), int(line))
    return None


def first_line(kind: str, text: str) -> str:
    """What was wrong: the exception and its message; of one without any, the line that raised it."""
    said, _, _ = text.partition("\n")
    if not said.strip() or said.startswith("  File "):
        lines = [line for _, _, line in _FRAME.findall(text) if line]
        said = lines[-1] if lines else ""
    return f"{kind}: {said.strip()}" if kind and said.strip() else said.strip() or kind


def shown_path(path: Path) -> str:
    """As seen from the current folder, if it is below."""
    here = Path.cwd().resolve()
    return file_name(path.relative_to(here) if path.is_relative_to(here) else path)
