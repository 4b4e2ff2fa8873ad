"""The error of an unusable shape file, and file access that raises it."""

from __future__ import annotations

from pathlib import Path

from sim_action.core.files import read_at_most
from sim_action.core.workspace import PathError, Workspace


class ShapeError(ValueError):
    """An unusable shape; `key`: the key below it that causes this; `number`: its index in `shapes`, if any."""

    def __init__(self, message: str, key: str = "file") -> None:
        self.key = key
        self.number: int | None = None
        super().__init__(message)


def read_bytes(path: Path, name: str, most: int, key: str = "file") -> bytes:
    """Return the bytes of a file; `name`: as in the scenario. Raises ShapeError."""
    try:
        data = read_at_most(path, most)
    except OSError as error:
        raise ShapeError(f"'{name}' cannot be read: {error.strerror}", key) from None
    if data is None:
        raise ShapeError(f"'{name}' is larger than {most / 1e6:g} MB, the limit for this kind of file", key)
    return data


def found_file(workspace: Workspace, name: str, key: str = "file") -> Path:
    """Return the path of a file that a scenario names. Raises ShapeError."""
    try:
        return workspace.file(name)
    except PathError as error:
        raise ShapeError(str(error), key) from None
