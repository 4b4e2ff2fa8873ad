"""What the launcher tells of its nodes: lines of JSON in a file, read as they come."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final, Literal

from sim_action.commands.stderr_tail import LastWords
from sim_action.core.errors import ScriptError
from sim_action.core.field_types import FrozenModel
from sim_action.core.messages import did_you_mean, escaped_line
from sim_action.ros.ros1.judging.launch_output import (
    Death,
    last_exception,
    plain,
    refused,
    signal_name,
    traceback_location,
    xacro_error,
)
from sim_action.ros.ros1.launch.overlay import Overlay


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


_MOST_DETAILS: Final = 4_000
# As roslaunch's own Python says of a package that nobody has.
_NOT_FOUND: Final = "ResourceNotFound"


class LaunchErrors:
    """Turns ends into errors, with what was printed last.

    Args:
        workspace: in which the user's own code is.
    """

    def __init__(self, workspace: Path, overlay: Overlay, words: LastWords) -> None:
        self._workspace, self._overlay, self._words = workspace, overlay, words

    def because_of(self, event: Event) -> ScriptError:
        """Of a node that has died, or a launch file that cannot be launched."""
        if event.event == "refused":
            # The launcher is about to leave: what it has printed is whole then.
            self._words.close()
            return self._error(f"nothing was launched: {self._why_refused(event)}")
        text, death = self._text(), event.death
        if not event.exit_code:
            return self._error(f"the node '{death.node}' finished during the run, and it is required")
        said = last_exception(text, death.program)
        required = "; it is required" if event.required else ""
        where = traceback_location(_after_mention(text, death.program), self._workspace) if said else None
        error = self._error(f"{death}{required}{f': {said}' if said else ''}")
        error.location = where
        return error

    def over(self, exit_code: int | None) -> ScriptError:
        """Of a launcher that nothing was heard from."""
        how = f" by {signal_name(-exit_code)}" if exit_code is not None and exit_code < 0 else ""
        return self._error(f"roslaunch ended{how} during the run, and its nodes ended with it")

    def late(self, what: str) -> ScriptError:
        """Of what takes too long."""
        return self._error(what)

    def _why_refused(self, event: Event) -> str:
        if event.kind == _NOT_FOUND:
            name = event.message.partition("\n")[0].strip()
            near = did_you_mean(name, self._overlay.packages)
            return f"it needs the package '{name}', which is neither in the workspace nor in ROS{near}"
        text = self._shown()
        return xacro_error(text) or refused(text) or event.message.strip().partition("\n")[0] or event.kind

    def _text(self) -> str:
        return plain(self._words.all())

    def _shown(self, text: str | None = None) -> str:
        """Without the folder in which launched processes see packages."""
        return (self._text() if text is None else text).replace(f"{self._overlay.variables['ROS_PACKAGE_PATH']}/", "")

    def _error(self, message: str) -> ScriptError:
        details = self._shown().strip("\n")[-_MOST_DETAILS:]
        return ScriptError(escaped_line(self._shown(message)), details=details)


def _after_mention(text: str, program: str) -> str:
    """What was printed of a program's own last exception."""
    start = text.rfind("Traceback (most recent call last)", 0, max(0, text.rfind(f'/{Path(program).name}", line ')))
    return text[start:] if start >= 0 else text
