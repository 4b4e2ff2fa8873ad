"""The search for programs of the system, such as git: none that a repository holds may be started."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

_SUFFIX: Final = ".exe" if os.name == "nt" else ""


def program_on_path(name: str, *workspaces: Path) -> Path | None:
    """Return the absolute path of a program, from the folders of PATH; None: it was not found.

    A folder counts if its name is absolute, and if it is not the current folder and not inside one of `workspaces` or
    the workspace of the job. Windows, and `shutil.which` there, would look in the current folder first.
    """
    job = os.environ.get("GITHUB_WORKSPACE")
    untrusted = [Path(os.path.realpath(folder)) for folder in (*workspaces, *([Path(job)] if job else []))]
    for entry in os.environ.get("PATH", "").split(os.pathsep):
        folder = Path(entry.strip('"'))
        if not folder.is_absolute():
            continue
        real = Path(os.path.realpath(folder))
        if real == Path.cwd() or any(real.is_relative_to(place) for place in untrusted):
            continue
        program = folder / f"{name}{_SUFFIX}"
        if program.is_file() and os.access(program, os.X_OK):
            return program
    return None
