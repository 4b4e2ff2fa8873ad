"""The events of the launcher, read as lines of JSON from a file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal

from sim_action.core.field_types import FrozenModel


class Event(FrozenModel):
    """One event of a launch.

    Attributes:
        time: sim time in s for which the launch is calm, or at which a timer is due.
        pid: of the launcher for "calm", else of the process.
        process: name of the process, such as "mover-1".
        program: its path, or PACKAGE/PROGRAM if it is left out; the class of a node in a container.
        node: full name of the node, if the launch file states it.
        clock: number of the clock of the node; None: it has no clock of its own.
        args: arguments of a program that is left out.
        exit_code: negative for a signal.
        kind: of a refusal: "package", "program", "argument", "start", or the class of an exception.
        name: the package, program or argument that is not known; `names`: those that are.
        package: the package that lacks a program.
        message: the exception; the reason of a shutdown.
        places: (file, line) of each call that led to the exception, the last one last.
    """

    event: Literal["calm", "timer", "process", "composed", "left out", "died", "refused", "shutdown"]
    time: float = 0.0
    pid: int = 0
    process: str = ""
    program: str = ""
    node: str = ""
    clock: int | None = None
    args: tuple[str, ...] = ()
    exit_code: int = 0
    kind: str = ""
    name: str = ""
    names: tuple[str, ...] = ()
    package: str = ""
    message: str = ""
    places: tuple[tuple[str, int], ...] = ()


class Events:
    """The events of one launch, in their order."""

    def __init__(self, path: Path) -> None:
        path.touch()
        self._file = path.open("rb")
        self._unread = b""

    def new(self) -> list[Event]:
        """Return the events since the last call."""
        data = self._file.read()
        if not data:
            return []
        *lines, self._unread = (self._unread + data).split(b"\n")
        return [Event.model_validate(_plain(json.loads(line))) for line in lines]

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def _plain(value: Any) -> Any:
    if isinstance(value, list):
        return tuple(map(_plain, value))
    return {key: _plain(each) for key, each in value.items()} if isinstance(value, dict) else value
