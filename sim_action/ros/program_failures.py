"""The failures of programs: exit codes and signals in words, and the places and messages of tracebacks."""

from __future__ import annotations

import re
from pathlib import Path
from signal import Signals
from typing import Final

from sim_action.core.discovery import file_name
from sim_action.core.errors import Location

_FRAME: Final = re.compile(r'^ *File "([^"]+)", line ([0-9]{1,9})(?:, in .*)?\n(?: {4,}(\S.*))?', re.MULTILINE)


def signal_name(number: int) -> str:
    """Return the name of a signal, such as SIGKILL."""
    return Signals(number).name if number in set(Signals) else f"signal {number}"


def exit_text(code: int) -> str:
    """Return an exit code in words, negative for a signal: "exit code 1", or "SIGKILL"."""
    return f"exit code {code}" if code >= 0 else signal_name(-code)


def traceback_location(text: str, workspace: Path) -> Location | None:
    """Return the innermost place of a traceback that is in the workspace."""
    root = workspace.resolve()
    for file, line, _ in reversed(_FRAME.findall(text)):
        try:
            path = Path(file).resolve()
        except (OSError, ValueError, RuntimeError):  # too long, with a NUL, or links in a circle
            continue
        if path.is_relative_to(root):
            return Location(shown_path(path), int(line))
    return None


def exception_line(kind: str, text: str) -> str:
    """Return the exception and its message, or the line that raised it if there is no message."""
    said, _, _ = text.partition("\n")
    if not said.strip() or said.startswith("  File "):
        lines = [line for _, _, line in _FRAME.findall(text) if line]
        said = lines[-1] if lines else ""
    return f"{kind}: {said.strip()}" if kind and said.strip() else said.strip() or kind


def shown_path(path: Path) -> str:
    """Return a path relative to the current folder, if it is inside."""
    here = Path.cwd().resolve()
    return file_name(path.relative_to(here) if path.is_relative_to(here) else path)
