"""The events of a launch of either ROS, as its launcher writes them: lines of JSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Literal

from sim_action.core.field_types import FrozenModel


class Event(FrozenModel):
    """One event of a launch.

    `time`: s for which the launch is calm, or at which a timer is due. `pid`: of the launcher for "started" and "calm".
    `program`: its path, or PACKAGE/PROGRAM if it is left out; the class of a node in a container. `node`: full name, if
    the file states it. `clock` None: the process has no clock of its own. `exit_code`: negative for a signal. `kind`:
    of a refusal: "package", "program", "argument", "start", "unsupported", or the class of an exception. `names`: near
    the unknown `name`. `places`: (file, line) of each call that led to the exception, the last one last.

    In ROS 1, `args` of a program that is left out are one text; `types`: NAME=TYPE of each controller that has
    parameters, and `world`, once the file is read; `core`: ids of the processes of ROS itself.
    """

    event: Literal["calm", "composed", "died", "left out", "process", "read", "refused", "shutdown", "started", "timer"]
    time: float = 0.0
    pid: int = 0
    process: str = ""
    program: str = ""
    node: str = ""
    clock: int | None = None
    args: tuple[str, ...] = ()
    exit_code: int | None = None
    required: bool = False
    kind: str = ""
    name: str = ""
    names: tuple[str, ...] = ()
    package: str = ""
    message: str = ""
    places: tuple[tuple[str, int], ...] = ()
    types: tuple[str, ...] = ()
    world: str = ""
    core: tuple[int, ...] = ()


class EventFile:
    """The events of one launch, in their order."""

    def __init__(self, path: Path) -> None:
        path.touch()
        self._file = path.open("rb")
        self._unread = b""

    def new(self) -> list[Event]:
        """Return the events since the last call."""
        if not (data := self._file.read()):
            return []
        *lines, self._unread = (self._unread + data).split(b"\n")
        # Unlike pydantic, json reads the bytes of file names that are not UTF-8; its lists become tuples.
        return [Event.model_validate(json.loads(line), strict=False) for line in lines]

    def close(self) -> None:
        """Close the file."""
        self._file.close()
