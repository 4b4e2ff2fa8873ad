"""What to say when a launch, or one of its nodes, has ended as it should not."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from sim_action.commands.last_words import LastWords
from sim_action.core.errors import ScriptError
from sim_action.core.messages import did_you_mean, escaped_line
from sim_action.ros.ros1.driving.events import Event
from sim_action.ros.ros1.overlay import Overlay
from sim_action.ros.ros1.printed import last_exception, plain, refused, signal_name, xacro_error
from sim_action.ros.ros1.traceback_text import location_in

_MOST_DETAILS: Final = 4_000
# As roslaunch's own Python says of a package that nobody has.
_NOT_FOUND: Final = "ResourceNotFound"


class Failing:
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
            return self._error(f"nothing could be launched: {self._why_refused(event)}")
        text, death = self._text(), event.death
        if not event.exit_code:
            return self._error(f"the node '{death.node}' has finished, and nothing goes on without it: it is required")
        said = last_exception(text, death.program)
        required = "; it is required" if event.required else ""
        where = location_in(_after_mention(text, death.program), self._workspace) if said else None
        error = self._error(f"{death}{required}{f': {said}' if said else ''}")
        error.location = where
        return error

    def over(self, exit_code: int | None) -> ScriptError:
        """Of a launcher that nothing was heard from."""
        how = f" by {signal_name(-exit_code)}" if exit_code is not None and exit_code < 0 else ""
        return self._error(f"roslaunch has ended{how} in the midst of the run, and its nodes with it")

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
