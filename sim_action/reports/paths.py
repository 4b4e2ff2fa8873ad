"""Paths as reports show them: seen from the workspace, with forward slashes."""

from __future__ import annotations

import os
from pathlib import Path

from sim_action.core.errors import Location
from sim_action.results.outcome import Outcome


def seen_from(workspace: Path, file: str | Path) -> str:
    """A path relative to the workspace if it is inside, else absolute; relative ones start from the current folder."""
    try:
        absolute = Path(os.path.abspath(file))  # noqa: PTH100 - links are kept as they are written
        candidates = [(absolute, Path(os.path.abspath(workspace)))]  # noqa: PTH100 - as above
        candidates.append((absolute.resolve(), workspace.resolve()))
    except (OSError, ValueError, RuntimeError):
        # A text that can be no path, such as one with a NUL in it, or a link that leads in a circle.
        return str(file)
    for path, root in candidates:
        if path.is_relative_to(root):
            return path.relative_to(root).as_posix()
    return absolute.as_posix()


def place(workspace: Path, location: Location) -> str:
    """`path:line`, or the path alone."""
    path = seen_from(workspace, location.file)
    return path if location.line is None else f"{path}:{location.line}"


def stored_trace(outcome: Outcome, folder: Path) -> Path | None:
    """The trace of an outcome, whose results file is in `folder`."""
    return folder / outcome.trace if outcome.trace else None
