"""The errors of a launch: files that `launch` refuses, programs that do not start, and processes that end."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from sim_action.core.errors import Location, ScriptError
from sim_action.core.wording import did_you_mean, escaped_line
from sim_action.ros.program_failures import exit_text, shown_path
from sim_action.ros.ros2.diagnosis.node_endings import ending_of
from sim_action.ros.ros2.launch.launch_events import Event

_MAX_DETAILS_CHARS: Final = 4_000
_NO_MODULE: Final = re.compile(r"^ModuleNotFoundError: No module named '(launch\w*|ament_index_python)", re.MULTILINE)


class LaunchErrors:
    """Makes errors from events; `workspace`: the folder of the user's own code."""

    def __init__(self, workspace: Path) -> None:
        self._workspace = workspace.resolve()

    def of_refusal(self, event: Event, output: str) -> ScriptError:
        """Return the error for a launch file that cannot be run as it is written."""
        error = _error(f"the launch file cannot be run: {_why_refused(event)}", output)
        error.location = self._place(event)
        return error

    def of_death(self, event: Event, output: str) -> ScriptError:
        """Return the error for a process that has failed."""
        code = event.exit_code
        text = text_of(event.process, output)
        ending = ending_of(f"{text}\n", self._workspace)
        error = _error(f"the node '{event.process}' of the launch file ended with {exit_text(code)}{ending.said}", text)
        error.location = ending.location
        return error

    def of_shutdown(self, event: Event, output: str) -> ScriptError:
        """Return the error for a launch that its own actions have ended."""
        return _error(f"the launch file ended the launch during the run: {event.message}", output)

    def of_end(self, exit_code: int, output: str) -> ScriptError:
        """Return the error for a launcher that ended without an event."""
        if missing := _NO_MODULE.search(output):
            return _error(
                f"launch files need the Python package '{missing[1]}' of ROS 2, which this ROS 2 lacks (the wheels on "
                "PyPI have none): use ROS 2 of /opt/ros or RoboStack, or list the nodes under 'nodes'",
                output,
            )
        return _error(f"the launcher ended with {exit_text(exit_code)}, and its nodes ended with it", output)

    def _place(self, event: Event) -> Location | None:
        """Return the innermost place in the user's code that led to a refusal."""
        for file, line in reversed(event.places):
            path = Path(file).resolve()
            if path.is_relative_to(self._workspace):
                return Location(shown_path(path), line or None)
        return None


def text_of(process: str, output: str) -> str:
    """Return the lines that one process has printed."""
    prefix = f"[{process}] "
    return "\n".join(line.removeprefix(prefix) for line in output.splitlines() if line.startswith(prefix))


def _why_refused(event: Event) -> str:
    near = did_you_mean(event.name, event.names)
    if event.kind == "package":
        return f"there is no package '{event.name}' in the workspace or ROS 2{near}"
    if event.kind == "PackageNotFoundError":
        # The first quoted word of its message is the package.
        name = event.message.partition("'")[2].partition("'")[0]
        return f"there is no package '{name}' in the workspace or ROS 2{did_you_mean(name, event.names)}"
    if event.kind == "program":
        return f"the package '{event.package}' has no executable '{event.name}'{near}"
    if event.kind == "argument":
        return f"it has no argument '{event.name}'{near}"
    if event.kind == "start":
        return f"'{event.name}' cannot be started: {event.message}"
    return f"{event.kind}: {event.message.partition(chr(10))[0]}"


def _error(message: str, output: str) -> ScriptError:
    return ScriptError(escaped_line(message), details=output.strip("\n")[-_MAX_DETAILS_CHARS:])
