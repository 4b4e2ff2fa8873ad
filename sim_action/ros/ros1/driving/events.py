"""What the launcher tells of its nodes: lines of JSON in a file, read as they come."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal

from sim_action.core.field_types import FrozenModel
from sim_action.ros.ros1.printed import Death


class Event(FrozenModel):
    """One thing that has happened.

    Attributes:
        left_out: nodes of Gazebo, each as package/type, once the launch file is read.
        pid: of the launcher, when all is started; of a node that has died.
        core: processes of ROS itself, which keep nothing.
        exit_code: negative, if it was a signal; None: nobody knows.
        required: whether nothing goes on without that node.
        kind, message: of the exception that a launch file is refused by.
    """

    event: Literal["read", "started", "refused", "died"]
    left_out: tuple[str, ...] = ()
    pid: int = 0
    core: tuple[int, ...] = ()
    node: str = ""
    exit_code: int | None = None
    program: str = ""
    required: bool = False
    kind: str = ""
    message: str = ""

    @property
    def death(self) -> Death:
        """The same of a node that has died."""
        return Death(self.node, self.exit_code or 0, self.program)

    @property
    def is_failure(self) -> bool:
        """Whether nothing that comes after it counts."""
        return self.event == "refused" or (self.event == "died" and (self.required or self.exit_code != 0))


class Events:
    """Those of one launch, in their order."""

    def __init__(self, path: Path) -> None:
        path.touch()
        self._file = path.open("rb")
        self._unread = b""

    def new(self) -> list[Event]:
        """What was told since the last call."""
        *lines, self._unread = (self._unread + self._file.read()).split(b"\n")
        return [Event.model_validate(_plain(json.loads(line))) for line in lines]

    def close(self) -> None:
        """Lets go of the file."""
        self._file.close()


def _plain(data: dict[str, Any]) -> dict[str, Any]:
    """Lists of JSON are tuples here."""
    return {key: tuple(value) if isinstance(value, list) else value for key, value in data.items()}
