"""The events of the launcher, read as lines of JSON from a file, and the errors that they lead to."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final, Literal

from sim_action.commands.stderr_tail import StderrTail
from sim_action.core.errors import ScriptError
from sim_action.core.field_types import FrozenModel
from sim_action.core.wording import did_you_mean, escaped_line
from sim_action.ros.program_failures import signal_name, traceback_location
from sim_action.ros.ros1.command_source.replaced_nodes import ReplacedNode, lost_nodes
from sim_action.ros.ros1.launch.overlay import Overlay
from sim_action.ros.ros1.verdicts.launch_output import Death, cleaned_output, last_exception, refusal, xacro_error

_MAX_DETAILS_CHARS: Final = 4_000
# The exception of roslaunch for a missing package.
_NOT_FOUND: Final = "ResourceNotFound"


class Event(FrozenModel):
    """One event of a launch.

    Attributes:
        left_out: nodes of Gazebo as package/type, once the launch file is read.
        left_out_args: their arguments.
        world: the world that the launch file names; empty if it names none.
        types: NAME=TYPE of each controller that has parameters.
        pid: of the launcher, when all nodes are started; of a node that has ended.
        core: ids of the processes of ROS itself, which hold no results.
        exit_code: negative for a signal; None: unknown.
        required: True if the launch ends with this node.
        kind, message: of the exception by which roslaunch refused the launch file.
    """

    event: Literal["read", "started", "refused", "died"]
    left_out: tuple[str, ...] = ()
    left_out_args: tuple[str, ...] = ()
    world: str = ""
    types: tuple[str, ...] = ()
    pid: int = 0
    core: tuple[int, ...] = ()
    node: str = ""
    exit_code: int | None = None
    program: str = ""
    required: bool = False
    kind: str = ""
    message: str = ""

    @property
    def losses(self) -> tuple[str, ...]:
        """The parts of the launch file that the scenario does not replace."""
        pairs = zip(self.left_out, self.left_out_args, strict=True)
        nodes = [ReplacedNode(program=program, args=args) for program, args in pairs]
        types = dict(text.split("=", 1) for text in self.types)
        return tuple(lost_nodes(nodes, self.world, types))

    @property
    def death(self) -> Death:
        """The ended node of an event "died"."""
        return Death(self.node, self.exit_code or 0, self.program)

    @property
    def is_failure(self) -> bool:
        """True if the event ends the run with an error."""
        return self.event == "refused" or (self.event == "died" and (self.required or self.exit_code != 0))


class Events:
    """The events of one launch, in their order."""

    def __init__(self, path: Path) -> None:
        path.touch()
        self._file = path.open("rb")
        self._unread = b""

    def new(self) -> list[Event]:
        """Return the events since the last call."""
        *lines, self._unread = (self._unread + self._file.read()).split(b"\n")
        return [Event.model_validate(_plain(json.loads(line))) for line in lines]

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def _plain(data: dict[str, Any]) -> dict[str, Any]:
    return {key: tuple(value) if isinstance(value, list) else value for key, value in data.items()}


class LaunchErrors:
    """Makes errors from the ends of launches and nodes, with the last output.

    Args:
        workspace: the folder of the user's own code.
    """

    def __init__(self, workspace: Path, overlay: Overlay, words: StderrTail) -> None:
        self._workspace, self._overlay, self._words = workspace, overlay, words

    def of_event(self, event: Event) -> ScriptError:
        """Return the error for a node that has ended, or for a launch file that was refused."""
        if event.event == "refused":
            # The launcher is about to leave: its output is complete after that.
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

    def of_end(self, exit_code: int | None) -> ScriptError:
        """Return the error for a launcher that ended without an event."""
        how = f" by {signal_name(-exit_code)}" if exit_code is not None and exit_code < 0 else ""
        return self._error(f"roslaunch ended{how} during the run, and its nodes ended with it")

    def of_delay(self, what: str) -> ScriptError:
        """Return the error for a step that takes too long."""
        return self._error(what)

    def _why_refused(self, event: Event) -> str:
        if event.kind == _NOT_FOUND:
            name = event.message.partition("\n")[0].strip()
            near = did_you_mean(name, self._overlay.packages)
            return f"it needs the package '{name}', which is neither in the workspace nor in ROS{near}"
        text = self._shown()
        return xacro_error(text) or refusal(text) or event.message.strip().partition("\n")[0] or event.kind

    def _text(self) -> str:
        return cleaned_output(self._words.all())

    def _shown(self, text: str | None = None) -> str:
        return (self._text() if text is None else text).replace(f"{self._overlay.variables['ROS_PACKAGE_PATH']}/", "")

    def _error(self, message: str) -> ScriptError:
        details = self._shown().strip("\n")[-_MAX_DETAILS_CHARS:]
        return ScriptError(escaped_line(self._shown(message)), details=details)


def _after_mention(text: str, program: str) -> str:
    start = text.rfind("Traceback (most recent call last)", 0, max(0, text.rfind(f'/{Path(program).name}", line ')))
    return text[start:] if start >= 0 else text
