"""Which program the first word of a command means."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from sim_action.core.workspace import PathError, Workspace


def program_of(word: str, workspace: Workspace) -> Path:
    """With a slash it is a file of the workspace; else it is looked for on PATH. Raises PathError."""
    if "/" in word or os.sep in word:
        if not os.access(workspace.file(word), os.X_OK):
            raise PathError(f"'{word}' may not be executed; chmod +x, or begin with what runs it, such as python3")
        # Not what a link leads to: a Python knows its virtual environment by the name that it was called by.
        return (workspace.directory / word).absolute()
    on_path = shutil.which(word)
    if on_path is None:
        beside = workspace.directory / word
        hint = f"; the file beside the scenario is './{word}'" if beside.is_file() else ""
        raise PathError(f"no program '{word}' is on PATH{hint}")
    return Path(on_path).absolute()
