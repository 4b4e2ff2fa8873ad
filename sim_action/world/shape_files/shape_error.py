"""What can be wrong with a file that a body's shape is read from."""

from __future__ import annotations

from pathlib import Path

from sim_action.core.files import read_at_most
from sim_action.core.workspace import PathError, Workspace


class ShapeError(ValueError):
    """A shape that cannot be had; `key`: below the shape's own, that is to blame."""

    def __init__(self, message: str, key: str = "file") -> None:
        self.key = key
        super().__init__(message)


def read_bytes(path: Path, name: str, most: int, key: str = "file") -> bytes:
    """The bytes of a file that the scenario calls `name`. Raises ShapeError."""
    try:
        data = read_at_most(path, most)
    except OSError as error:
        raise ShapeError(f"'{name}' cannot be read: {error.strerror}", key) from None
    if data is None:
        raise ShapeError(f"'{name}' has more than {most / 1e6:g} MB, which is all that is read", key)
    return data


def found_file(workspace: Workspace, name: str, key: str = "file") -> Path:
    """Where a file is that a scenario names. Raises ShapeError."""
    try:
        return workspace.file(name)
    except PathError as error:
        raise ShapeError(str(error), key) from None
